import logging
import textwrap
from types import SimpleNamespace

import pytest

from mocapflow.errors import PluginError, UnknownComponent
from mocapflow.hookspecs import hookimpl
from mocapflow.registry import PROVIDERS, Origin, Registry, load_registry
from tests.fixtures import broken_plugins

OURS = Origin("cape", "mocapflow-cape", "0.3")
OTHER = Origin("wardrobe", "mocapflow-wardrobe", "1.0")


def registry_of(*plugins):
    registry = Registry()
    for origin, load in plugins:
        registry.add(origin, load)
    return registry


def test_a_component_is_found_with_its_origin():
    registry = registry_of((OURS, broken_plugins.good))
    cls = registry.get("garment", "cape")
    assert cls is broken_plugins.Cape
    assert registry.origin(cls) == OURS
    assert registry.names("garment") == ("cape",)
    assert registry.plugins == (OURS,)


def test_the_origin_of_a_component_is_known_before_its_role_is_asked_for():
    assert registry_of((OURS, broken_plugins.good)).origin(broken_plugins.Cape) == OURS
    with pytest.raises(KeyError):
        registry_of((OTHER, broken_plugins.import_error)).origin(broken_plugins.Cape)


def test_unknown_component_lists_what_exists_and_the_nearest():
    registry = registry_of((OURS, broken_plugins.good))
    with pytest.raises(UnknownComponent) as caught:
        registry.get("garment", "caep")
    assert str(caught.value) == "no garment named 'caep'\n       available: cape — did you mean 'cape'?"


def test_unknown_role():
    with pytest.raises(UnknownComponent, match=r"there is no role 'drapper'\n +available: .*did you mean 'draper'\?"):
        Registry().get("drapper", "kinematic")


@pytest.mark.parametrize(
    ("plugin", "role", "said"),
    [
        ("import_error", "garment", "ModuleNotFoundError: No module named 'triangle'"),
        ("unknown_hook", "garment", "unknown hook 'mocapflow_garment' — did you mean 'mocapflow_garments'?"),
        ("unmarked", "garment", "mocapflow_garments lacks @mocapflow.hookimpl"),
        ("hookless", "garment", "it has no hook, such as mocapflow_priors, that returns its components"),
    ],
)
def test_a_plugin_that_does_not_load_is_told_when_something_is_missing(plugin, role, said):
    registry = registry_of((OURS, getattr(broken_plugins, plugin)), (OTHER, broken_plugins.good))
    assert registry.names("garment") == ("cape",)
    with pytest.raises(UnknownComponent) as caught:
        registry.get(role, "gown")
    assert caught.value.hint == f"available: cape\nnote: plugin 'cape' (mocapflow-cape 0.3) did not load: {said}"


@pytest.mark.parametrize(
    ("plugin", "role", "said"),
    [
        ("wrong_base", "draper", "mocapflow_drapers returned Cape, which is not a Draper"),
        ("unfinished", "draper", "Draper Unfinished does not define drape"),
        ("outdated", "draper", "Draper Outdated: drape has to take (self, poses, parameters, past, scene)"),
        ("nameless", "garment", 'Garment Nameless has no name: write `name = "..."` in the class'),
        ("annotated", "garment", 'Garment Annotated has its name as a setting: write `name = "..."`, without a type'),
        ("instance", "garment", "mocapflow_garments returned an instance of Cape: return the class, Cape without ()"),
        ("unlisted", "garment", "mocapflow_garments returned Cape, not a list of classes"),
        ("silent", "garment", "mocapflow_garments returned None, not a list of classes"),
        ("failing_provider", "draper", "ModuleNotFoundError: No module named 'triangle'"),
        ("leaving_provider", "garment", "it left with status 0"),
    ],
)
def test_a_provider_that_returns_something_wrong(plugin, role, said):
    registry = registry_of((OURS, getattr(broken_plugins, plugin)))
    with pytest.raises(UnknownComponent) as caught:
        registry.get(role, "gown")
    note = f"note: plugin 'cape' (mocapflow-cape 0.3) did not load its {role} components: {said}"
    assert caught.value.hint == f"available: none\n{note}"


def test_a_component_under_the_hook_of_another_role_is_told_to_who_asks_for_it():
    """Whoever takes a garment for a draper asks for the draper, or for the garment."""
    registry = registry_of((OURS, broken_plugins.wrong_base))
    for role in ("draper", "prior"):
        with pytest.raises(UnknownComponent) as caught:
            registry.get(role, "gown")
        assert "mocapflow_drapers returned Cape, which is not a Draper" in caught.value.hint


def test_what_pydantic_says_of_a_setting_is_told_in_one_line():
    (failure,) = registry_of((OURS, broken_plugins.without_a_type)).failures
    assert "did not load: PydanticUserError: A non-annotated attribute was detected: `length_m = 1.1`" in str(failure)
    assert "\n" not in str(failure)


def test_a_failing_provider_leaves_the_other_roles_of_its_plugin():
    registry = registry_of((OURS, broken_plugins.failing_provider))
    assert registry.names("draper") == ()
    assert registry.names("garment") == ("cape",)
    assert [failure.role for failure in registry.failures] == ["draper"]


def test_an_observer_with_a_wrong_argument_does_not_load():
    registry = registry_of((OURS, broken_plugins.wrong_argument))
    assert "{'picture'} are declared in the hookimpl but can not be found" in str(registry.failures[0])


def test_two_components_of_one_name_are_an_error_naming_both_plugins():
    registry = registry_of((OURS, broken_plugins.good), (OTHER, broken_plugins.duplicate))
    with pytest.raises(PluginError) as caught:
        registry.get("garment", "cape")
    assert str(caught.value) == (
        "two plugins provide a garment named 'cape': "
        "plugin 'cape' (mocapflow-cape 0.3) and plugin 'wardrobe' (mocapflow-wardrobe 1.0)\n"
        "       uninstall one of them, or give its component another name"
    )


def test_installed_plugins_come_sorted_with_the_built_in_ones_first(tmp_path, monkeypatch):
    for distribution, plugin in [("aaa-cape", "z_cape"), ("mocapflow-zzz", "a_cape")]:
        info = tmp_path / f"{distribution.replace('-', '_')}-0.3.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 0.3\n")
        (info / "entry_points.txt").write_text(f"[mocapflow]\n{plugin} = absent_{plugin}\n")
    monkeypatch.syspath_prepend(tmp_path)
    registry = load_registry()
    assert {origin.distribution for origin in registry.plugins} == {"mocapflow"}
    names = [origin.plugin for origin in registry.plugins]
    assert names == sorted(names)
    shipped = "levelset matching twist draping garments priors bodies fitting sequence export evaluation report"
    assert set(shipped.split()) <= set(names)
    assert list(map(str, registry.failures)) == [
        "plugin 'z_cape' (aaa-cape 0.3) did not load: ModuleNotFoundError: No module named 'absent_z_cape'",
        "plugin 'a_cape' (mocapflow-zzz 0.3) did not load: ModuleNotFoundError: No module named 'absent_a_cape'",
    ]


def test_a_plugin_file(tmp_path):
    file = tmp_path / "my_dress.py"
    file.write_text(
        textwrap.dedent("""
        from __future__ import annotations
        from typing import Annotated
        from pydantic import Field
        from mocapflow import Garment, hookimpl

        class Dress(Garment):
            name = "dress"
            length_m: Annotated[float, Field(gt=0)] = 1.2
            def sew(self, body): ...

        @hookimpl
        def mocapflow_garments():
            return [Dress]
        """)
    )
    registry = load_registry([file])
    dress = registry.get("garment", "dress")
    assert dress().length_m == 1.2
    assert registry.origin(dress) == Origin("my_dress", str(file))
    assert str(registry.origin(dress)) == f"plugin 'my_dress' ({file})"


def test_a_hook_under_another_name():
    def dresses():
        return [broken_plugins.Cape]

    plugin = SimpleNamespace(dresses=hookimpl(specname="mocapflow_garments")(dresses))
    assert registry_of((OURS, lambda: plugin)).names("garment") == ("cape",)


def test_a_plugin_file_that_is_not_there(tmp_path):
    (failure,) = load_registry([tmp_path / "nowhere.py"]).failures
    assert str(failure).endswith(f"did not load: there is no file {tmp_path / 'nowhere.py'}")


def test_every_provider_has_a_role():
    from mocapflow import hookspecs

    hooks = {name for name in vars(hookspecs) if name.startswith("mocapflow_") and not name.endswith("_done")}
    assert hooks == {hook for hook, _ in PROVIDERS.values()}


def test_observers_are_told_and_a_raising_one_is_switched_off(caplog):
    told = []

    @hookimpl
    def mocapflow_iteration_done(frame, iteration, state):
        told.append(("iteration", frame, iteration, state))

    @hookimpl
    def mocapflow_frame_done(result, frame):
        told.append(("frame", frame, result))

    @hookimpl
    def mocapflow_stage_done(stage):
        told.append(("stage", stage))

    @hookimpl(specname="mocapflow_frame_done")
    def mocapflow_frame_done_badly(frame):
        told.append("bad")
        raise ValueError("no window")

    good = SimpleNamespace(
        mocapflow_iteration_done=mocapflow_iteration_done,
        mocapflow_frame_done=mocapflow_frame_done,
        mocapflow_stage_done=mocapflow_stage_done,
    )
    bad = SimpleNamespace(mocapflow_frame_done=mocapflow_frame_done_badly)
    registry = registry_of((OURS, lambda: good), (OTHER, lambda: bad))
    with caplog.at_level(logging.WARNING, "mocapflow"):
        registry.observers.iteration_done(3, 1, "state")
        registry.observers.frame_done(3, "result")
        registry.observers.frame_done(4, "result")
        registry.observers.stage_done("track", "7f3a", cached=False)
    assert told.count("bad") == 1
    assert [news for news in told if news != "bad"] == [
        ("iteration", 3, 1, "state"),
        ("frame", 3, "result"),
        ("frame", 4, "result"),
        ("stage", "track"),
    ]
    assert caplog.messages == [
        "observer mocapflow_frame_done of plugin 'mocapflow-wardrobe:wardrobe' raised ValueError: no window; "
        "it is switched off for the rest of this run"
    ]


def test_an_observer_that_leaves_does_not_end_the_run(caplog):
    @hookimpl
    def mocapflow_frame_done(frame):
        raise SystemExit(0)

    registry = registry_of((OURS, lambda: SimpleNamespace(mocapflow_frame_done=mocapflow_frame_done)))
    registry.observers.frame_done(3, "result")
    assert "mocapflow_frame_done of plugin 'mocapflow-cape:cape' raised SystemExit: 0" in caplog.text


def test_an_observer_that_is_interrupted_does_not_keep_it_to_itself():
    @hookimpl
    def mocapflow_frame_done(frame):
        raise SystemError("CPUDispatcher returned a result with an exception set") from KeyboardInterrupt()

    registry = registry_of((OURS, lambda: SimpleNamespace(mocapflow_frame_done=mocapflow_frame_done)))
    with pytest.raises(KeyboardInterrupt):
        registry.observers.frame_done(3, "result")
