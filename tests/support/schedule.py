"""What is handed to the processes that test: all tests of a file, or of a group; what they share is made once."""

from collections import Counter

from xdist.scheduler import LoadGroupScheduling

LONG = (  # files of few tests that take long
    *("test_attacks", "test_packaging", "test_batch_cluster", "test_batch_trouble", "test_batch_interrupts"),
    *("test_theorem_joined", "test_theorem_clock", "test_theorem", "test_theorem_members", "test_algebraic"),
    *("test_theorem_kernel", "test_report_browser", "test_sizes", "test_batch", "test_forging_deletions"),
)


def unit(item):
    """Name of the group of a test, or else of its file."""
    group = item.get_closest_marker("xdist_group")
    return group.args[0] if group else item.path.stem


def begin_with_the_longest(items):
    """Sort tests, so that at the end no process waits for another."""
    sizes = Counter(map(unit, items))
    items.sort(key=lambda item: (unit(item) not in LONG, -sizes[unit(item)], unit(item)))


class Schedule(LoadGroupScheduling):
    """That of --dist=loadgroup in the order of the tests, whose other tests go by files and not one by one."""

    def __init__(self, config, log=None):
        super().__init__(config, log)
        config.option.loadscopereorder = False

    def _split_scope(self, nodeid):
        group = super()._split_scope(nodeid)
        return nodeid.split("::")[0] if group == nodeid else group
