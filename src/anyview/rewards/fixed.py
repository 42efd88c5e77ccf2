"""What rewards have in common that nothing changes once they are made."""

from anyview.learners.common.interfaces import Arrays


class FixedReward:
    """What a ``RewardSource`` has beside ``step`` if it learns nothing and remembers nothing."""

    def end_iteration(self) -> Arrays:
        """Nothing to learn or log."""
        return {}

    def rescored(self) -> None:
        """It never changes."""

    def state(self) -> Arrays:
        """Nothing beyond what it is made from."""
        return {}

    def restore(self, state: Arrays) -> None:
        """Nothing to restore."""
