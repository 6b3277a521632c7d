"""What can go wrong, as one tree.

    SeamlogError
    ├── UsageError                       the caller asked for something that makes no sense
    │   ├── ConfigError                  faults in a configuration, all of them at once
    │   ├── OutputExists (FileExistsError)
    │   └── UnknownName (KeyError)       a plug-in, topic or command nobody registered
    ├── InputError                       an input cannot be read
    │   ├── SessionError                 a session file: damaged, foreign, cut
    │   │   ├── ChannelMissing (KeyError)
    │   │   └── FrameMissing (LookupError)
    │   ├── LimitExceeded (MemoryError)  an input larger than the limits allow
    │   ├── ImageError (ValueError)      a picture that cannot be decoded or is no picture
    │   ├── CalibrationError (ValueError)
    │   ├── ImportFailed (ValueError)    a foreign file that its importer cannot map
    │   └── ResultsError                 a results directory
    ├── HardwareError                    a device, driver or extra is missing
    │   ├── SourceMissing
    │   └── SpaceMissing (OSError)
    ├── PluginFailed                     a plug-in or the user's own code raised or gave nonsense
    ├── EvidenceError                    the data cannot tell; an answer would be invented
    └── RecordingError                   misuse of the recorder by the live loop (strict mode)

Each message says what, where (file, byte offset, topic, time) and what to do.
Errors of the file system itself pass through as the `OSError` they are.
Exit codes are made in `seamlog.cli` and nowhere else.
"""


class SeamlogError(Exception):
    """Root of all errors that seamlog raises on purpose."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else self.__class__.__name__


class UsageError(SeamlogError):
    """The request itself makes no sense."""


class ConfigError(UsageError):
    """One or more faults in a configuration; `faults` lists each with its dotted path."""

    def __init__(self, message: str, faults: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.faults = faults


class OutputExists(UsageError, FileExistsError):
    """An output is there already and nobody said that it may be replaced."""


class UnknownName(UsageError, KeyError):
    """A name that nobody registered; the message lists the known ones."""


class InputError(SeamlogError):
    """An input cannot be read."""


class SessionError(InputError):
    """A session file is damaged, foreign or cut."""


class ChannelMissing(SessionError, KeyError):
    """A session has no channel of this topic."""


class FrameMissing(SessionError, LookupError):
    """A session has no frame at the time asked for."""


class LimitExceeded(InputError, MemoryError):
    """An input asks for more memory than the limits allow."""


class ImageError(InputError, ValueError):
    """A picture cannot be decoded, or shows nothing that can be measured."""


class CalibrationError(InputError, ValueError):
    """A calibration file is unreadable or does not fit its picture."""


class ImportFailed(InputError, ValueError):
    """A foreign file cannot be turned into a session."""


class ResultsError(InputError):
    """A results directory is missing, foreign or damaged."""


class HardwareError(SeamlogError):
    """A device, driver or optional dependency is missing."""


class SourceMissing(HardwareError):
    """A source of live data is not there."""


class SpaceMissing(HardwareError, OSError):
    """Not enough space in shared memory or on the disk."""


class PluginFailed(SeamlogError):
    """A plug-in or the user's own code raised, or gave what is no answer."""


class EvidenceError(SeamlogError):
    """The data cannot answer the question; any number would be invented."""


class RecordingError(SeamlogError):
    """The live loop used the recorder wrongly (raised in strict mode only)."""
