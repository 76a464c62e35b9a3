"""What was changed, element by element."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Change:
    """One element of a file and what became of it."""

    file: str
    element: str
    id: str
    what: str  # the rule
    to: str  # what stands there now

    def as_row(self) -> dict[str, str]:
        """The change as a row of changes.json."""
        return {"file": self.file, "element": self.element, "id": self.id, "what": self.what, "to": self.to}
