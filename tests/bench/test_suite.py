"""From a suite file and the user's choices to cases."""

import re
from pathlib import Path

import pytest

from aliasbench.bench.suite import Request, plan_run
from aliasbench.bench.suite_file import SUITES, Group, parse_suite, read_suite
from aliasbench.scenes.errors import InputError

SMALL = """
schema = 1
name = "small"
size = [8, 4]
frames = 2
techniques = ["raytrace", "raster:msaa=4"]
scenes = ["one", "two"]
[[case]]
scenes = ["three:a=1"]
techniques = ["raster-1"]
frames = "loop"
seeds = 3
rounds = 2
metrics = ["rmse"]
texture_truth = "linear"
"""


@pytest.fixture
def small(tmp_path: Path) -> str:
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return str(path)


@pytest.mark.usefixtures("fakes")
class TestPlan:
    def test_cases_are_scenes_by_techniques_with_every_default_resolved(self, small: str) -> None:
        plan = plan_run(Request(small))
        assert plan.name == "small"
        assert [(c.scene.name, c.technique.text, c.size, c.frames, c.seeds, c.rounds) for c in plan.cases] == [
            ("one", "raytrace:", (8, 4), 2, (0,), 5),
            ("one", "raster:msaa=4", (8, 4), 2, (0,), 5),
            ("two", "raytrace:", (8, 4), 2, (0,), 5),
            ("two", "raster:msaa=4", (8, 4), 2, (0,), 5),
            ("three:a=1", "raster:", (8, 4), 1, (0, 1, 2), 2),
        ]
        assert [c.metrics for c in plan.cases] == [None] * 4 + [("rmse",)]
        assert [c.texture_truth for c in plan.cases] == ["point"] * 4 + ["linear"]

    def test_ids_are_unique_file_names_and_the_same_every_time(self, small: str) -> None:
        ids = [c.id for c in plan_run(Request(small)).cases]
        assert len(set(ids)) == 5
        assert ids == [c.id for c in plan_run(Request(small)).cases]
        assert all(re.fullmatch(r"[A-Za-z0-9.-]{1,120}", i) for i in ids)

    def test_whatever_changes_pixels_changes_the_id(self, small: str) -> None:
        base = {c.id for c in plan_run(Request(small)).cases}
        for other in (Request(small, size=(9, 4)), Request(small, frames=3), Request(small, seeds=2)):
            assert base.isdisjoint(c.id for c in plan_run(other).cases)
        assert base == {c.id for c in plan_run(Request(small, rounds=9)).cases}

    def test_scenes_and_techniques_choose_among_the_cases_of_a_suite(self, small: str) -> None:
        def chosen(**choice: tuple[str, ...]) -> list[tuple[str, str]]:
            return [(c.scene.name, c.technique.text) for c in plan_run(Request(small, **choice)).cases]

        assert chosen(scenes=("two",)) == [("two", "raytrace:"), ("two", "raster:msaa=4")]
        assert chosen(scenes=("three",)) == [("three:a=1", "raster:")]
        assert chosen(techniques=("raster-msaa-4",), scenes=("one",)) == [("one", "raster:msaa=4")]
        with pytest.raises(InputError, match=r"unknown scene of this suite: 'tow'; did you mean 'two'\?"):
            chosen(scenes=("tow",))
        with pytest.raises(InputError, match=r"unknown technique of this suite: 'raster:msaa=8'; did you mean"):
            chosen(techniques=("raster:msaa=8",))

    def test_without_a_suite_scenes_meet_the_techniques_given_or_those_of_the_quick_suite(self) -> None:
        given = plan_run(Request(scenes=("one",), techniques=("raytrace:spp=4",)))
        assert [c.technique.text for c in given.cases] == ["raytrace:spp=4"]
        default = plan_run(Request(scenes=("one", "two")))
        techniques = read_suite("quick").groups[0].techniques
        assert len(default.cases) == 2 * len(techniques)
        with pytest.raises(InputError, match="nothing to run: name a suite, or scenes with --scene"):
            plan_run(Request(techniques=("raytrace:",)))

    def test_shards_are_disjoint_and_together_the_suite(self, small: str) -> None:
        whole = [c.id for c in plan_run(Request(small)).cases]
        for count in (1, 2, 3, 5, 7):
            shards = [[c.id for c in plan_run(Request(small, shard=(i + 1, count))).cases] for i in range(count)]
            assert sorted(i for shard in shards for i in shard) == sorted(whole)

    def test_cases_of_one_scene_and_size_follow_each_other(self, tmp_path: Path) -> None:
        path = tmp_path / "s.toml"
        path.write_text(
            'schema = 1\nscenes = ["a", "b"]\ntechniques = ["raster:"]\nframes = 1\n'
            '[[case]]\nscenes = ["a"]\ntechniques = ["raytrace:"]\n[[case]]\nscenes = ["a"]\nsize = [9, 9]\n'
        )
        found = [(c.scene.name, c.size, c.technique.text) for c in plan_run(Request(str(path))).cases]
        assert found == [
            ("a", (256, 256), "raster:"),
            ("a", (256, 256), "raytrace:"),
            ("b", (256, 256), "raster:"),
            ("a", (9, 9), "raster:"),
        ]

    def test_the_same_case_twice_is_an_error(self, tmp_path: Path) -> None:
        path = tmp_path / "s.toml"
        path.write_text('schema = 1\nscenes = ["a"]\ntechniques = ["raster:", "raster-1"]\n')
        with pytest.raises(InputError, match="a by raster: is there twice"):
            plan_run(Request(str(path)))

    @pytest.mark.parametrize(
        ("one", "other"),
        [
            ("raytrace:", "raytrace:spp=1"),
            ("raster:", "raster:texture=nearest"),
            ("raytrace:spp=4,filter=tent", "raytrace:filter=pyramid,spp=4,sampler=jittered"),
        ],
    )
    def test_the_same_technique_spelled_differently_is_the_same_case(
        self, tmp_path: Path, one: str, other: str
    ) -> None:
        path = tmp_path / "s.toml"
        path.write_text(f'schema = 1\nscenes = ["a"]\ntechniques = ["{one}", "{other}"]\n')
        with pytest.raises(InputError, match=f"a by {one} is there twice: {other} is the same technique"):
            plan_run(Request(str(path)))
        with pytest.raises(InputError, match="is there twice"):
            plan_run(Request(scenes=("a",), techniques=(one, other)))
        path.write_text(f'schema = 1\nscenes = ["a"]\ntechniques = ["{one}", "raster:msaa=4"]\n')
        chosen = plan_run(Request(str(path), techniques=(other,))).cases
        assert [case.technique.text for case in chosen] == [one]

    def test_a_bad_technique_names_the_suite(self, tmp_path: Path) -> None:
        path = tmp_path / "s.toml"
        path.write_text('schema = 1\nscenes = ["a"]\ntechniques = ["raster:mssa=4"]\n')
        with pytest.raises(InputError, match=r"s\.toml: .*mssa.*msaa"):
            plan_run(Request(str(path)))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("scenes = [1 2]", r"S: not valid TOML: .*line 2, column"),
        (f"rounds = {'9' * 5000}", r"S: not valid TOML: a number has too many digits$"),
        (f"rounds = 0x{'f' * 9000}", r"S: rounds = a number too long to be shown: must be a whole number"),
        (f"scenes = {'[' * 100_000}", r"S: not valid TOML: its values are nested too deeply$"),
        (f"size{'.a' * 12_000} = 1", r"S: size = a value nested too deeply to be shown: must be \[width, height\]"),
        (f"name = [{'1, ' * 1000}]", r"S: name = .{29}….{30}: must be text$"),
        ("schema = 2", r"S: schema = 2 is newer than this version, which reads up to 1"),
        ("schema = 'x'", r"S: schema = 'x': must be 1"),
        ("sizes = [1, 1]", r"S: unknown key 'sizes'; did you mean 'size'\?"),
        ("size = [0, 4]", r"S: size = \[0, 4\]: must be a whole number from 1 to 65536"),
        ("size = 4", r"S: size = 4: must be \[width, height\]"),
        ("frames = 0", r'S: frames = 0: must be a whole number from 1 to 1000000, or "loop"'),
        ("frames = true", r"S: frames = True: must be a whole number"),
        ("seeds = []", r"S: seeds = \[\]: must be different seeds"),
        ("seeds = [1, 1]", r"S: seeds = \[1, 1\]: must be different seeds"),
        ("seeds = 0", r"S: seeds = 0: must be a whole number from 1 to 4096"),
        ("rounds = 1.5", r"S: rounds = 1.5: must be a whole number from 1"),
        ("scenes = 'a'", r"S: scenes = 'a': must be a list of texts"),
        ("scenes = ['a', 'a']", r"S: scenes = .*: 'a' is there twice"),
        ("scenes = ['a']", r"S: techniques is missing in group 0"),
        ("techniques = ['raster:']", r"S: no scenes"),
        ("name = 3", r"S: name = 3: must be text"),
        ("case = 3", r"S: case: must be tables"),
        ("[[case]]\nscene = ['a']", r"S: case\[0\]: unknown key 'scene'; did you mean 'scenes'\?"),
        ("metrics = ['rsme']", r"S: metrics = .*: unknown metric 'rsme'; did you mean 'rmse'\?"),
        ("texture_truth = 'ewa'", r'S: texture_truth = \'ewa\': must be "point" or "linear"'),
    ],
)
def test_a_wrong_suite_says_where_what_and_what_is_allowed(text: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        parse_suite(text if text.startswith("schema") else f"schema = 1\n{text}", "S", None, "s")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("# nothing\n", r"S: is empty; a suite needs schema = 1, scenes = \[...\] and techniques = \[...\]$"),
        ("scenes = ['a']", r"S: schema is missing; give schema = 1 at the top$"),
    ],
)
def test_a_suite_says_what_is_missing(text: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        parse_suite(text, "S", None, "s")


def test_a_suite_may_name_metrics_that_are_not_measured_by_default() -> None:
    text = "schema = 1\nmetrics = ['rmse', 'cvvdp']\n[[case]]\nscenes = ['a']\ntechniques = ['b']"
    assert parse_suite(text, "S", None, "s").groups[0].metrics == ("rmse", "cvvdp")


def test_groups_take_from_above_what_they_leave_out() -> None:
    text = "schema = 1\nrounds = 3\nsize = [2, 1]\n[[case]]\nscenes = ['a']\ntechniques = ['b']"
    suite = parse_suite(text, "S", None, "s")
    assert suite.groups == (Group(("a",), ("b",), (2, 1), "loop", (0,), 3),)
    assert suite.name == "s"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("quik", r"unknown suite 'quik'; did you mean 'quick'\? known: hard-cases, quick \(or a path"),
        ("missing.toml", r"suite 'missing.toml': no such file"),
        ("no/folder", r"suite 'no/folder': no such file"),
    ],
)
def test_a_suite_that_is_not_there_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        read_suite(text)


def test_a_suite_that_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_bytes(b"# \xff\xfe\x00")
    with pytest.raises(InputError, match=r"s\.toml': byte 2 is not UTF-8; a suite file is a TOML text in UTF-8$"):
        read_suite(str(tmp_path / "s.toml"))


def test_a_byte_order_mark_is_no_part_of_a_suite(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_bytes(b"\xef\xbb\xbf" + SMALL.encode())
    assert read_suite(str(tmp_path / "s.toml")).name == "small"


def test_a_name_that_no_file_can_have_is_refused() -> None:
    with pytest.raises(InputError, match=r"suite 'x{28}….*: cannot be read \(File name too long\)$"):
        read_suite("x" * 5000 + ".toml")


@pytest.mark.parametrize("name", SUITES)
def test_packaged_suites_can_be_planned(name: str) -> None:
    plan = plan_run(Request(name))
    assert plan.name == name
    assert len(plan.cases) + len(plan.checks) > 0
    assert SUITES[name].summary
