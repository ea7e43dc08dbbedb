"""What is handed to the processes that test: one test after another, or all of a group."""

from xdist.scheduler import LoadGroupScheduling


class Schedule(LoadGroupScheduling):
    """That of --dist=loadgroup, which forgets what is done: else all that is counted again after every test."""

    def mark_test_complete(self, node, item_index, duration=0):  # noqa: ARG002
        nodeid = self.registered_collections[node][item_index]
        scope, units = self._split_scope(nodeid), self.assigned_work[node]
        units[scope][nodeid] = True
        if all(units[scope].values()):
            del units[scope]
        self._reschedule(node)
