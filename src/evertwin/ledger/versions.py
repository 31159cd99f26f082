"""The versions that a twin has had, and the stages that run them.

Append-only: a number names a version for ever. Stages are built once per version.

>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> model = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(u="1"),
...     Layout.of(y="1"), Layout(), Parameters.of(gain=(1.0, "1")))
>>> versions = Versions(model)
>>> versions.add(Form(), {"gain": 1.1}, parent=0, reason="tuned").number
1
>>> [v.values for v in versions]
[(1.0,), (1.1,)]
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from evertwin.errors import UsageError
from evertwin.models import Model
from evertwin.models.corrected.corrected import build
from evertwin.models.form import Form, Size, Version

FORMER = 8
"""Versions at most that may come back."""


class Versions:
    """Append-only list of versions over one base model.

    >>> Versions.__name__
    'Versions'
    """

    def __init__(self, base: Model, form: Form | None = None) -> None:
        self.base = base
        self._versions: list[Version] = []
        self._models: dict[Form, Model] = {}
        self._known = 0
        self.add(form or Form(), {}, parent=None, reason="as configured")

    def add(
        self,
        form: Form,
        values: Mapping[str, float],
        *,
        parent: int | None,
        reason: str,
        row: int = 0,
        sizes: tuple[Size, ...] = (),
    ) -> Version:
        """A new version of ``form``; values not named are the parent's, or the model's own;
        so are ``sizes`` where none are given.

        After `rewind`, a version that comes out as before is the one that is kept already.
        """
        parameters = self.model_of(form).parameters
        old = {} if parent is None else dict(self.values(parent))
        known = {k: v for k, v in (old | dict(values)).items() if k in parameters.names}
        unknown = set(values) - set(parameters.names)
        if unknown:
            raise UsageError(f"version: no parameters {sorted(unknown)} in this form")
        filled = [known.get(item.name, item.value) for item in parameters]
        sizes = sizes or (() if parent is None else self[parent].sizes)
        number = self._known
        version = Version(number, form, parameters.names, tuple(filled), parent, reason, row, sizes)
        if number == len(self._versions) or self._versions[number] != version:
            version = replace(version, number=len(self._versions))
            self._versions.append(version)
        self._known = version.number + 1
        return version

    @property
    def known(self) -> int:
        """Versions so far, where the fold is; fewer than there are while it repeats itself."""
        return self._known

    def rewind(self, count: int) -> None:
        """As it was with ``count`` versions; later ones keep their numbers."""
        self._known = count

    def restore(self, versions: list[Version]) -> None:
        """Replaces the list by the one a store has kept."""
        self._versions = list(versions)
        self._known = len(versions)

    def values(self, number: int) -> Mapping[str, float]:
        """Parameter values of a version, by name."""
        version = self[number]
        return dict(zip(version.names, version.values, strict=True))

    def before(self, number: int) -> tuple[Version, ...]:
        """Those that were live before a version, newest first: it was made from one, and so on."""
        found, at = list[Version](), self[number].parent
        while at is not None and len(found) < FORMER:
            found.append(self[at])
            at = self[at].parent
        return tuple(found)

    def model_of(self, form: Form) -> Model:
        """The model of a form, built once."""
        if form not in self._models:
            self._models[form] = build(self.base, form)
        return self._models[form]

    def model(self, number: int) -> Model:
        """The model of a version (its parameters carry the base model's values)."""
        return self.model_of(self[number].form)

    def __getitem__(self, number: int) -> Version:
        if not 0 <= number < len(self._versions):
            raise UsageError(
                f"version: there are 0 to {len(self._versions) - 1}, got {number}: list them with "
                "evertwin model list; versions outlive a run only with [store] path"
            )
        return self._versions[number]

    def __iter__(self) -> Iterator[Version]:
        return iter(self._versions)

    def __len__(self) -> int:
        return len(self._versions)
