"""`obsdesign schema`: what an editor wants to know of a spec."""

import json

from obsdesign.cli.printing import say


def schema() -> None:
    """Print the JSON Schema of a spec file."""
    from obsdesign.reading import json_schema

    say(json.dumps(json_schema(), indent=2))
