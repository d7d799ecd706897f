"""Declaration of a stage, and its view of the configuration.

A stage is one frozen value, ``STAGE``, in a module of `maglev.stages` of the same name.  Its
command, its rule, its part of the configuration, the attributes of its file, its fingerprint and
its page in the documentation follow from it.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from inspect import getattr_static
from pathlib import Path
from types import FunctionType, MethodType
from typing import TYPE_CHECKING, Any, Literal, cast

from maglev.config import named_files
from maglev.errors import UserError
from maglev.fingerprint import code_of, file_hash
from maglev.parameters import Config, Parameters
from maglev.vocabulary import BASELINE, METHODS, Method, Response

if TYPE_CHECKING:
    import xarray as xr
    from pydantic.fields import FieldInfo

_FOLDER = Path(__file__).parent / "stages"

EVERY_STAGE = ("demonstration",)
"""Keys that every stage reads: its file says whether it is a demonstration."""


@dataclass(frozen=True)
class Input:
    """One input of a stage, named after the stage that makes it.

    Parameters
    ----------
    layout
        A key of `maglev.datasets.LAYOUTS`.
    by
        Names that distinguish several files of the role, such as ``("method",)``: the stage is
        then given a mapping by such a name, or by tuples of names.  Empty for one file.
    methods
        Methods for which a stage of each method takes the role.
    optional
        Whether the stage also works without the file.
    """

    layout: str
    by: tuple[str, ...] = ()
    methods: tuple[Method, ...] = METHODS
    optional: bool = False


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Declaration of a stage: name, inputs, keys of the configuration, layout, function.

    Parameters
    ----------
    name
        Name of its module, its rule and, with dashes, its command.
    of
        Whether there is one file of a run, of each case, or of each case and method.
    reads
        Dotted keys of the configuration, sections whole; ``{case}`` and ``{method}`` stand for
        the case and the method.  `EVERY_STAGE` is read besides.
    inputs
        Files by their role.
    layout
        A key of `maglev.datasets.LAYOUTS`: what its file holds.
    compute
        The function.  It receives the view of the configuration, then by name the given ``takes``
        and ``inputs``, and returns the dataset.
    takes
        Further arguments with their types: ``case``, ``method``, ``store`` (folder in which
        runs are kept), ``n_threads``, or any other name, which is a wildcard of its rule.
    methods
        Methods for which its file is made; for a stage of each case, the case needs one of them.
    table
        From the described dataset to rows and text of a table that is written beside the file as
        CSV and Markdown.
    """

    name: str
    of: Literal["run", "case", "method"]
    reads: tuple[str, ...]
    layout: str
    compute: Callable[..., xr.Dataset]
    inputs: Mapping[str, Input] = field(default_factory=dict)
    takes: Mapping[str, type] = field(default_factory=dict)
    methods: tuple[Method, ...] = METHODS
    table: Callable[[xr.Dataset], tuple[list[dict[str, object]], str]] | None = None

    @property
    def command(self) -> str:
        """Its name on the command line."""
        return self.name.replace("_", "-")

    @property
    def code(self) -> str:
        """Fingerprint of all the code behind its function, the declaration left out."""
        return code_of(f"stages.{self.name}", without=["stage"])

    @property
    def options(self) -> tuple[str, ...]:
        """Names of the options of its command, in order; see `flag`."""
        of = {"run": (), "case": ("case",), "method": ("case", "method")}[self.of]
        others = (name for name in self.takes if name not in of)
        return ("config", *of, *self.inputs, *others, "out")

    @property
    def reads_of(self) -> Literal["run", "case", "method"]:
        """Whether its keys depend on the run alone, on the case, or on the method."""
        names = [name for name in ("method", "case") if any(f"{{{name}}}" in r for r in self.reads)]
        return cast(Literal["run", "case", "method"], names[0] if names else "run")

    def roles(self, method: str | None = None) -> dict[str, Input]:
        """Its inputs by name; with a method, only those of that method."""
        return {
            role: one
            for role, one in self.inputs.items()
            if method is None or method in one.methods
        }

    def keys(self, case: str | None = None, method: str | None = None) -> tuple[str, ...]:
        """Dotted keys of the configuration that it reads, case and method filled in.

        Raises
        ------
        UserError
            If it needs a case or a method that is not named.
        """
        for name, given in (("case", case), ("method", method)):
            if given is None and any(f"{{{name}}}" in one for one in self.reads):
                raise UserError(f"{self.name}: which {name} must be said, got none")
        return tuple(one.format(case=case, method=method) for one in (*EVERY_STAGE, *self.reads))

    def slice(
        self, config: Config, case: str | None = None, method: str | None = None
    ) -> dict[str, Any]:
        """Part of a configuration that the stage reads, in the form of a configuration file.

        Parameters
        ----------
        config
            The whole configuration.
        case, method
            Names of the case and the method, where its keys depend on them.

        Returns
        -------
        part
            Of a stage that reads its case: without the other cases, the case's own values in their
            sections and the guideway with its spans; its methods are the one method.  Of a stage
            that reads responses of the study: those of the limit states among them.
        """
        keys = self.keys(case, method)
        if case is not None and self.reads_of != "run":
            config = config.with_case_set(case)
        whole = config.with_responses().quantities()
        part = _chosen(whole, keys)
        if "study" in part and "limit_states" not in part:  # their responses are in the study
            part["limit_states"] = dict.fromkeys(Config.model_fields["limit_states"].default)
        if self.reads_of != "run":
            assert case is not None  # keys has asked for it
            own = {"methods": [method or BASELINE], **part.get("cases", {}).get(case, {})}
            part["cases"] = {**dict.fromkeys(whole["cases"]), case: own}
            if "guideway" in part:
                n_spans = whole["cases"][case]["n_spans"] or whole["guideway"]["n_spans"]
                part["guideway"] = {**part["guideway"], "n_spans": n_spans}
        return part

    def files(
        self, config: Config, case: str | None = None, method: str | None = None
    ) -> dict[str, str]:
        """Files named in its part of the configuration, by the last word of their key."""
        part = self.slice(config, case, method)
        return {keys[-1].removesuffix("_file"): name for keys, name in named_files(part)}

    def view(self, config: Config, case: str | None = None, method: str | None = None) -> Config:
        """The configuration as the stage may read it: any other key is refused.

        Raises
        ------
        UserError
            If there is no such case, or the stage makes nothing for the method.
        """
        if self.of == "method" and method not in self.methods:
            raise UserError(f"{self.name} needs a method of {', '.join(self.methods)}: {method}")
        if self.reads_of != "run" and case not in config.cases:
            raise UserError(f"there is no case '{case}', known are: {', '.join(config.cases)}")
        if case is not None and self.reads_of != "run":
            config = config.with_case_set(case)
        config = config.with_responses()
        hashes = {name: file_hash(path) for name, path in self.files(config, case, method).items()}
        keys = self.keys(case, method)
        return cast(Config, View(self.name, config, keys, files=tuple(sorted(hashes.items()))))

    def write(
        self,
        dataset: xr.Dataset,
        path: str | Path,
        config: Config,
        inputs: Mapping[str, str | Path] | None = None,
        *,
        case: str | None = None,
        method: str | None = None,
    ) -> None:
        """Write the dataset with the attributes that document its origin.

        Parameters
        ----------
        dataset
            What the stage has computed.
        path
            File to write.
        config
            Configuration behind the dataset.
        inputs
            Files it was computed from, by their role.
        case, method
            Names of the case and the method it belongs to, if it belongs to one.

        Raises
        ------
        UserError
            If the dataset is not what the stage's layout says.
        """
        from maglev import datasets

        names = {"case": case, "method": method}
        datasets.write(
            dataset.assign_attrs({key: name for key, name in names.items() if name is not None}),
            path,
            self.layout,
            config=self.slice(config, case, method),
            code=self.code,
            inputs={**self.files(config, case, method), **(inputs or {})},
        )


class UndeclaredKeyError(LookupError):
    """A stage has read an undeclared key of the configuration."""


class View:
    """A section of the configuration restricted to the declared keys of a stage.

    It replaces the section: methods and properties of the section see the view.  Two views are
    equal if all their declared values are equal, and named files by their bytes.

    Parameters
    ----------
    stage
        Name of the stage.
    section
        The configuration or a part of it.
    reads
        Dotted keys inside the section that may be read.
    prefix
        Dotted key of the section in the configuration, with a dot behind it.
    files
        Hashes of the files that are named in it.
    """

    def __init__(
        self,
        stage: str,
        section: Parameters | Mapping[str, Any],
        reads: tuple[str, ...],
        prefix: str = "",
        files: tuple[tuple[str, str], ...] = (),
    ) -> None:
        self._stage, self._section, self._reads = stage, section, reads
        self._prefix, self._files = prefix, files

    def _read(self, name: str) -> Any:
        section = self._section
        value = section[name] if isinstance(section, Mapping) else getattr(section, name)
        if name in self._reads:
            return value
        prefix = f"{name}."
        inside = tuple(one.removeprefix(prefix) for one in self._reads if one.startswith(prefix))
        if not inside:
            raise UndeclaredKeyError(
                f"the stage '{self._stage}' reads {self._prefix}{name}, which it has not declared; "
                f"add it to 'reads' of STAGE in maglev/stages/{self._stage}.py"
            )
        return View(self._stage, value, inside, f"{self._prefix}{prefix}")

    def __getattr__(self, name: str) -> Any:
        section = self.__dict__.get("_section")
        if isinstance(section, Parameters):
            kind = type(section)
            if name in kind.model_fields:
                return self._read(name)
            found = getattr_static(kind, name, None)
            if isinstance(found, property) and found.fget is not None:
                return found.fget(self)
            if isinstance(found, FunctionType) and not name.startswith("_"):
                return MethodType(found, self)
        raise AttributeError(f"{type(section).__name__} has no '{name}'")

    def __getitem__(self, name: str) -> Any:
        return self._read(name)

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys(one.split(".")[0] for one in self._reads))

    def __contains__(self, name: object) -> bool:
        return name in set(self)

    def field_named(self, name: str) -> FieldInfo:
        """Field of the section by its name.

        Raises
        ------
        KeyError
            If it has none of that name.
        """
        assert isinstance(self._section, Parameters)
        return self._section.field_named(name)

    def model_copy(self, *, update: Mapping[str, Any]) -> View:
        """The same view of a section with other values of some keys, which it must have read."""
        for name in update:
            self._read(name)
        assert isinstance(self._section, Parameters)
        changed = self._section.model_copy(update=update)
        return View(self._stage, changed, self._reads, self._prefix, self._files)

    def with_case_set(self, _name: str) -> View:
        """The view itself, in whose sections a case's own values already are."""
        return self

    def with_responses(self) -> View:
        """The view itself: its study has named all responses since it was made."""
        return self

    @property
    def responses_of_study(self) -> tuple[Response, ...]:
        """Responses that are predicted, as the study of the view names them."""
        found: tuple[Response, ...] = self.study.responses
        return found

    @property
    def responses_of_designs(self) -> tuple[Response, ...]:
        """Responses that drive adaptive designs, likewise."""
        found: tuple[Response, ...] = self.study.asm.responses
        return found

    def quantities(self) -> dict[str, Any]:
        """Readable values in the form of a configuration file, units included."""
        assert isinstance(self._section, Parameters)
        return _chosen(self._section.quantities(), self._reads)

    def _key(self) -> tuple[object, ...]:
        return (json.dumps(self.quantities(), sort_keys=True), self._files)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, View) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())


def _chosen(whole: Mapping[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    """The values at dotted keys of nested mappings, nested likewise."""
    part: dict[str, Any] = {}
    for dotted in keys:
        *outer, last = dotted.split(".")
        source, target = whole, part
        for key in outer:
            source, target = source[key], target.setdefault(key, {})
        target[last] = source[last]
    return part


def flag(name: str) -> str:
    """An option as it stands on the command line, such as ``--threads`` for ``n_threads``.

    Examples
    --------
    >>> flag("n_threads")
    '--threads'
    """
    return f"--{name.removeprefix('n_').replace('_', '-')}"


def summary(name: str) -> str | None:
    """First sentence of the module of a stage, read without importing it; None if there is none.

    Examples
    --------
    >>> summary("passage")
    'One passage at the mean gains, with its histories.'
    """
    path = _FOLDER / f"{name}.py"
    tree = ast.parse(path.read_text(encoding="utf-8")) if path.is_file() else ast.Module([], [])
    targets = [each for node in tree.body if isinstance(node, ast.Assign) for each in node.targets]
    if not any(isinstance(each, ast.Name) and each.id == "STAGE" for each in targets):
        return None
    return (ast.get_docstring(tree) or "").split("\n\n")[0].replace("\n", " ")


def summaries() -> dict[str, str]:
    """Summary of each stage by its name.

    Examples
    --------
    >>> "passage" in summaries()
    True
    """
    found = {path.stem: summary(path.stem) for path in sorted(_FOLDER.glob("*.py"))}
    return {name: words for name, words in found.items() if words is not None}


def named(name: str) -> Stage:
    """The stage of a name.

    Examples
    --------
    >>> named("passage").layout
    'passage'
    """
    stage: Stage = import_module(f"maglev.stages.{name}").STAGE
    return stage


def stages() -> dict[str, Stage]:
    """All stages by their names; imports every module of a stage.

    Examples
    --------
    >>> stages().keys() == summaries().keys()
    True
    """
    return {name: named(name) for name in summaries()}
