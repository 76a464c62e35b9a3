"""A SUMO configuration and the files that it names, read whole and written anew into a folder of its own."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Self

from wzsumo.errors import MAX_SHOWN, PlacementError, is_file, one_line, reading
from wzsumo.placement.demand_files.vehicle_sizes import VehicleSize, sizes_on_roads
from wzsumo.placement.demand_files.vehicles import seconds_in
from wzsumo.placement.xml_file import Edits, Element, XmlFile, escaped

NET, ROUTES, ADDITIONALS, WEIGHTS = "net-file", "route-files", "additional-files", "weight-files"
BEGIN, STEP, GUI_SETTINGS = "begin", "step-length", "gui-settings-file"
GUI_SECTION = "gui_only"
DEFAULT_STEP_S = 1.0  # SUMO's
# SUMO's options by their other names (sumo --help).
_SYNONYMS = {
    "n": NET, "net": NET, "r": ROUTES, "a": ADDITIONALS, "additional": ADDITIONALS, "w": WEIGHTS,
    "weights": WEIGHTS, "g": GUI_SETTINGS, "gui-settings": GUI_SETTINGS, "b": BEGIN,
}  # fmt: skip
_STATES = ("load-state",)  # a saved state counts edges and lanes of the network that it was saved from
_WRITTEN = ("output", "log", "prefix", "save-state")  # what SUMO writes, by what the option's name holds
REQUIRED = (NET, ROUTES, ADDITIONALS, WEIGHTS)
DRAWING, DEFAULT_TYPE, CLOSURE = "wzsumo.zone.add.xml", "wzsumo.vtype.add.xml", "wzsumo.closure.add.xml"
VIEW = "wzsumo.zone.view.xml"
CONFIG = "run.sumocfg"


@dataclass(frozen=True, kw_only=True, eq=False)
class Option:
    """One option of a configuration: its element, and the files that it names."""

    name: str
    element: Element
    key: str  # of the attribute with the value
    files: tuple[Path, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Configuration:
    """What a simulation is made of; `file` is None where it was given file by file."""

    file: XmlFile | None
    net: Path
    routes: tuple[Path, ...]
    additionals: tuple[Path, ...]
    weights: tuple[Path, ...] = ()  # travel times by edge
    options: tuple[Option, ...] = ()  # of the configuration's file, those that name files
    outputs: tuple[str, ...] = ()  # names of files that SUMO writes, as the configuration's file has them
    gui_options: Element | None = None  # the last of the section <gui_only>
    begin: float = 0.0  # s, SUMO's time at which the simulation begins
    step_length: float = DEFAULT_STEP_S

    @classmethod
    def of_files(cls, net: Path, routes: Iterable[Path], additionals: Iterable[Path]) -> Self:
        """The configuration that has these files and SUMO's defaults."""
        return cls(file=None, net=net, routes=tuple(routes), additionals=tuple(additionals))

    @classmethod
    def read(cls, path: Path, *, net: Path) -> Self:
        """The configuration of a sumocfg. Raises PlacementError where a file that it names is missing."""
        file = XmlFile.read(path, role="the configuration")
        options: list[Option] = []
        times: dict[str, str] = {}
        gui_options: list[Element] = []
        outputs: list[str] = []

        def take(element: Element) -> None:
            if element.tag == GUI_SECTION:
                gui_options.extend(element.children)
            for item in element.walk():
                key = "value" if "value" in item.attributes else "v"
                name = _SYNONYMS.get(item.tag, item.tag)
                if name in {BEGIN, STEP}:
                    times[name] = item.get(key)
                if any(word in name for word in _WRITTEN):
                    outputs.append(item.get(key))
                if item.get(key) and (found := _files_of(name, item.get(key), path)):
                    options.append(Option(name=name, element=item, key=key, files=found))

        root = file.root_and_children(take)
        named = {option.name: option.files for option in options}
        if NET not in named:
            raise PlacementError(f"{path}: names no network (root <{root.tag}>, no net-file); give a sumocfg with <net-file>")
        if named[NET][0] != net.resolve():
            raise PlacementError(f"{path}: its net-file is {named[NET][0]}, not {net}; give the configuration of this network")
        return cls(
            file=file,
            net=net.resolve(),
            routes=named.get(ROUTES, ()),
            additionals=named.get(ADDITIONALS, ()),
            weights=named.get(WEIGHTS, ()),
            options=tuple(options),
            outputs=tuple(outputs),
            gui_options=gui_options[-1] if gui_options else None,
            begin=_seconds(path, times, BEGIN, 0.0),
            step_length=_seconds(path, times, STEP, DEFAULT_STEP_S),
        )

    def place_of_view(self) -> tuple[int, str]:
        """(byte of the configuration's file, text to insert there) so that sumo-gui opens with the view VIEW."""
        option = f'<{GUI_SETTINGS} value="{VIEW}"/>'
        if self.gui_options:
            return self.gui_options.end, f"\n        {option}"
        data = self.file.data if self.file else b""
        return data.rindex(b"</"), f"    <{GUI_SECTION}>\n        {option}\n    </{GUI_SECTION}>\n"

    @cached_property
    def vehicle_sizes(self) -> frozenset[VehicleSize]:
        """The sizes of vehicles that drive on the network's carriageways, cars among them."""
        files = (XmlFile.read(path, role="the demand") for path in self.demand)
        return sizes_on_roads(file for file in files if b"<vType" in file.data)  # routes alone can be large

    @property
    def demand(self) -> tuple[Path, ...]:
        """The files that may name edges."""
        return (*self.routes, *self.additionals, *self.weights)

    @property
    def others(self) -> tuple[Path, ...]:
        """Files that SUMO reads and that name no edges, such as settings of sumo-gui."""
        own = {self.net, *self.routes, *self.additionals, *self.weights}
        return tuple(dict.fromkeys(file for option in self.options for file in option.files if file not in own))


@dataclass(eq=False)
class ConfigurationFolder:
    """A folder into which a configuration is written with its files side by side, under names of their own."""

    folder: Path
    configuration: Configuration
    names: dict[Path, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Choose a name for each file: its own, with a number where two files share one."""
        configuration = self.configuration
        for path in (configuration.net, *configuration.demand, *configuration.others):
            taken = set(self.names.values()) | {CONFIG, DRAWING, DEFAULT_TYPE, CLOSURE, VIEW}
            candidates = (path.name if n == 0 else f"{n}_{path.name}" for n in range(1000))
            self.names.setdefault(path, next(name for name in candidates if name not in taken))
        self.folder.mkdir(parents=True)

    def write(self, path: Path, content: bytes) -> None:
        """Write one file of the configuration."""
        (self.folder / self.names[path]).write_bytes(content)

    def make_folders(self, outputs: Iterable[str]) -> None:
        """Make the folders within this one to which outputs of these names go: SUMO makes none, and ends without them."""
        for name in outputs:
            with reading(Path(name), error=PlacementError, remedy="give the output another name"):
                parent = (self.folder / name).parent.resolve()
                if parent.is_relative_to(self.folder.resolve()):
                    parent.mkdir(parents=True, exist_ok=True)

    def write_config(self, *, first: list[str], last: list[str]) -> None:
        """Write the configuration; `first` and `last` are additional files of the toolkit's, before and behind the others.

        sumo-gui opens with the view VIEW where the configuration names no settings of its own.
        """
        configuration = self.configuration
        additionals = [*first, *(self.names[path] for path in configuration.additionals), *last]
        if configuration.file is None:
            text = _plain_config(self.names[configuration.net], [self.names[p] for p in configuration.routes], additionals)
            (self.folder / CONFIG).write_text(text, encoding="utf-8")
            return
        edits = Edits(configuration.file)
        for option in configuration.options:
            names = additionals if option.name == ADDITIONALS else [self.names[path] for path in option.files]
            edits.set_attributes(option.element, {option.key: ",".join(names)})
        if additionals and not any(option.name == ADDITIONALS for option in configuration.options):
            net = next(option for option in configuration.options if option.name == NET)
            edits.insert(net.element.end, f'\n        <{ADDITIONALS} value="{escaped(",".join(additionals))}"/>')
        if not any(option.name == GUI_SETTINGS for option in configuration.options):
            edits.insert(*configuration.place_of_view())
        (self.folder / CONFIG).write_bytes(edits.apply())


def _files_of(name: str, value: str, config: Path) -> tuple[Path, ...]:
    """The files that an option names, relative to its configuration; none where it names no file that SUMO reads."""
    if name in _STATES:
        raise PlacementError(f"{config}: {name} loads a state of the uncut network; start the simulation without it")
    if any(word in name for word in _WRITTEN):
        return ()
    parts = [part.strip() for part in value.split(",") if part.strip()]
    paths = tuple(config.parent / part for part in parts)
    missing = [path for path in paths if not is_file(path)]
    if missing and name in REQUIRED:
        named = one_line(str(missing[0]), limit=MAX_SHOWN)
        raise PlacementError(f"{config}: {name} names {named}, which is no file; mend the name or add the file")
    return () if missing else tuple(path.resolve() for path in paths)


def _seconds(config: Path, times: dict[str, str], name: str, default: float) -> float:
    """The time [s] that an option gives. Raises PlacementError where it gives none."""
    if name not in times:
        return default
    seconds = seconds_in(times[name], float("nan"))
    if not math.isfinite(seconds):
        raise PlacementError(f"{config}: {name}={times[name]!r} is no time; give seconds, or hours:minutes:seconds")
    return seconds


def _plain_config(net: str, routes: list[str], additionals: list[str]) -> str:
    rows = [(NET, net)] + [(key, ",".join(names)) for key, names in ((ROUTES, routes), (ADDITIONALS, additionals)) if names]
    inputs = "\n".join(f'        <{key} value="{escaped(value)}"/>' for key, value in rows)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<configuration>\n    <input>\n'
        f'{inputs}\n    </input>\n    <gui_only>\n        <{GUI_SETTINGS} value="{VIEW}"/>\n    </gui_only>\n'
        '    <report>\n        <xml-validation value="never"/>\n    </report>\n</configuration>\n'
    )
