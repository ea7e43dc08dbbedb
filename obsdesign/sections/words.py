"""What messages say of a word that is not known, and of one that has a meaning elsewhere."""

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches

from obsdesign.sections.scalars import described


def nearest(word: str, words: Sequence[str]) -> str | None:
    """Return the word that was probably meant."""
    folded = {w.lower(): w for w in words}
    close = get_close_matches(word.lower(), folded, n=1)
    return folded[close[0]] if close else None


def unknown(kind: str, word: object, words: Sequence[str], hints: Mapping[str, str], beside: Sequence[str] = ()) -> str:
    """Say what is wrong with a word and which are allowed.

    `kind`: what the word should name, such as "key"; `words`: those that are allowed, and what else is, `beside` them;
    `hints`: what to say of words that have a meaning, but not here.
    """
    if not isinstance(word, str):
        return f"expected one of {', '.join((*words, *beside))}, found {described(word)}"
    plain = re.sub(r"[ _]", "-", word.lower())
    if hint := hints.get(word, hints.get(plain)):
        return f"{described(word)} {hint}"
    meant = nearest(word, (*words, *hints))
    told = (
        f" It {hints[meant]};" if meant and meant in hints and meant not in words else ""
    )  # else it led to the next error
    question = f"; did you mean {meant}?{told}" if meant else ";"
    return f"unknown {kind} {described(word)}{question} allowed: {', '.join((*words, *beside))}"
