"""Named errors. An `InputError` is one that the user can remedy: one line, exit code 2."""


class InputError(Exception):
    """Bad input: the message says what was given, the rule and the remedy. The command line exits with 2."""


class SpecError(InputError):
    """A scenario, study or parameter that is impossible or not supported."""


class TraceError(InputError):
    """A trace table that cannot be used: a column missing, a value not finite, too few traces."""


class MapError(InputError):
    """A map, or a pose on it, that cannot be used: image and metadata disagree, a pose lies outside."""


class CloudError(InputError):
    """A point cloud that cannot be used: wrong shape, a value not finite, too few points, an unknown format."""


class NoGroundError(CloudError):
    """A point cloud in which no ground was found, so that objects on it cannot be found either."""


class PlacementError(InputError):
    """A place in a network at which the zone cannot be set up, or a file of that network that cannot be used."""


class FeedError(InputError):
    """A WZDx feed that cannot be used: another version, no event of this road, broken geometry."""


class OutputError(InputError):
    """A file or folder to which results cannot be written."""


class SumoMissingError(InputError):
    """SUMO cannot be loaded on this machine."""


class DisplayError(InputError):
    """A window was asked for where none can be opened, or it was closed before the end."""


class SimulationError(Exception):
    """SUMO behaved in a way that the toolkit does not handle: a fault of the toolkit, exit code 1."""
