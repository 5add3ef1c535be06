"""Finds plugins, checks what they provide, and keeps their failures for whoever asks for what is missing.

A plugin is imported when the registry is loaded; its providers are called role by role, when a role is first
asked for, so that a command pays only for the components it uses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import pluggy

from mocapflow import components, hookspecs
from mocapflow.dressing import roles
from mocapflow.errors import PluginError, UnknownComponent, alternatives, raised
from mocapflow.guards.vetting import check_hooks, import_file, vetted
from mocapflow.observers import Observers
from mocapflow.settings import Component

GROUP = "mocapflow"  # entry point group, and the distribution of the built-in plugins
PROVIDERS: Mapping[str, tuple[str, type[Component]]] = {
    "predictor": ("mocapflow_predictors", components.Predictor),
    "segmenter": ("mocapflow_segmenters", components.Segmenter),
    "matcher": ("mocapflow_matchers", components.Matcher),
    "pose_solver": ("mocapflow_pose_solvers", components.PoseSolver),
    "draper": ("mocapflow_drapers", roles.Draper),
    "cloth_fitter": ("mocapflow_cloth_fitters", components.ClothFitter),
    "recovery": ("mocapflow_recoveries", components.Recovery),
    "prior": ("mocapflow_priors", components.Prior),
    "garment": ("mocapflow_garments", roles.Garment),
    "body": ("mocapflow_bodies", roles.BodyModel),
    "stage": ("mocapflow_stages", components.Stage),
}


@dataclass(frozen=True)
class Origin:
    """Where a component comes from; a plugin file has its path as distribution and no version."""

    plugin: str
    distribution: str
    version: str = ""

    def __str__(self) -> str:
        return f"plugin '{self.plugin}' ({' '.join(filter(None, [self.distribution, self.version]))})"


@dataclass(frozen=True)
class Failure:
    """A plugin, or one of its roles, that did not load."""

    origin: Origin
    error: Exception | SystemExit
    role: str = ""  # empty: the whole plugin

    def __str__(self) -> str:
        part = f" its {self.role} components" if self.role else ""
        return f"{self.origin} did not load{part}: {raised(self.error)}"


class Registry:
    """The components of all plugins by role and name; see `load_registry`."""

    def __init__(self) -> None:
        self._manager = pluggy.PluginManager("mocapflow")
        self._manager.add_hookspecs(hookspecs)
        self._plugins: dict[Origin, Any] = {}
        self._provided: dict[str, dict[str, list[type[Component]]]] = {}
        self._origins: dict[type[Component], Origin] = {}
        self._failures: list[Failure] = []
        self.observers = Observers(self._manager)

    @property
    def plugins(self) -> tuple[Origin, ...]:
        """The plugins that loaded."""
        return tuple(self._plugins)

    @property
    def packages(self) -> frozenset[str]:
        """The top names of the packages, or the modules, that the plugins are."""
        modules = (getattr(plugin, "__name__", type(plugin).__module__) for plugin in self._plugins.values())
        return frozenset(module.partition(".")[0] for module in modules)

    @property
    def failures(self) -> tuple[Failure, ...]:
        """What did not load so far; asking for the names of every role makes it complete."""
        return tuple(self._failures)

    def names(self, role: str) -> tuple[str, ...]:
        """Return the names of all components of a role, sorted."""
        return tuple(sorted(self.provided(role)))

    def get(self, role: str, name: str) -> type[Component]:
        """Return the component class of a role by name.

        Raises:
            UnknownComponent: no plugin provides it; the hint says what exists and what did not load.
            PluginError: two plugins provide it.
        """
        found = self.provided(role).get(name, [])
        if len(found) == 1:
            return found[0]
        if found:
            first, second = (self._origins[cls] for cls in found[:2])
            message = f"two plugins provide a {role} named '{name}': {first} and {second}"
            raise PluginError(message, hint="uninstall one of them, or give its component another name")
        for other in PROVIDERS:  # a plugin may give its component under another role's hook
            self.provided(other)
        notes = [f"note: {failure}" for failure in self._failures]
        hint = "\n".join([alternatives(name, self.names(role)), *notes])
        raise UnknownComponent(f"no {role} named '{name}'", hint=hint)

    def origin(self, cls: type[Component]) -> Origin:
        """Return the plugin that provides a component class; its role may not have been asked for yet.

        Raises:
            KeyError: no plugin provides it.
        """
        self.provided(cls.role)
        return self._origins[cls]

    def add(self, origin: Origin, load: Callable[[], Any]) -> None:
        """Load and register one plugin; remember its failure and go on."""
        try:
            plugin = load()
            check_hooks(plugin)
            self._manager.register(plugin, name=f"{origin.distribution}:{origin.plugin}")
            self._plugins[origin] = plugin
        except (Exception, SystemExit) as error:  # a foreign module may raise anything; it must not stop the others
            self._failures.append(Failure(origin, error))

    def provided(self, role: str) -> Mapping[str, Sequence[type[Component]]]:
        """Return the components of a role by name; a name with two of them is an error for who asks for it."""
        if role not in PROVIDERS:
            raise UnknownComponent(f"there is no role '{role}'", hint=alternatives(role, PROVIDERS))
        if role not in self._provided:
            self._provided[role] = {}
            for origin, plugin in self._plugins.items():
                self._call_provider(role, origin, plugin)
        return self._provided[role]

    def _call_provider(self, role: str, origin: Origin, plugin: Any) -> None:
        hook, base = PROVIDERS[role]
        implementations = getattr(self._manager.hook, hook).get_hookimpls()
        providers = [each.function for each in implementations if each.plugin is plugin]
        try:
            classes = [cls for provide in providers for cls in vetted(provide(), base, hook)]
        except (Exception, SystemExit) as error:
            self._failures.append(Failure(origin, error, role))
            return
        for cls in classes:
            self._provided[role].setdefault(cls.name, []).append(cls)
            self._origins[cls] = origin


def load_registry(local_files: Iterable[Path] = ()) -> Registry:
    """Return a registry of all installed plugins, the built-in ones first, and of plugin files."""
    registry = Registry()
    found = {_origin(entry): entry for entry in entry_points(group=GROUP)}
    for origin in sorted(found, key=lambda origin: (origin.distribution != GROUP, origin.distribution, origin.plugin)):
        registry.add(origin, found[origin].load)
    for path in local_files:
        registry.add(Origin(path.stem, str(path)), partial(import_file, path))
    return registry


def _origin(entry: EntryPoint) -> Origin:
    if entry.dist is None:
        return Origin(entry.name, "")
    metadata = entry.dist.metadata  # is read each time
    return Origin(entry.name, metadata["Name"], metadata["Version"])
