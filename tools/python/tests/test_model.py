"""The wheel: fits, models, networks, the benchmark. Needs the compiled package; skips without it and says so."""

import json
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

np = pytest.importorskip("numpy", reason="numpy is not installed: pip install 'tools/python[client]'")
pytest.importorskip("i2ris_native", reason="the wheel is not installed: maturin build, pip install")

from i2ris import benchmark, benchmark_table, gmr_direction, prandtl_ishlinskii, public  # noqa: E402
from i2ris.model import Calibration, Model, ModelError, from_onnx, from_torch, steps_by_travel, write_recording  # noqa: E402

CLI = os.environ.get("I2RIS_CLI")
#: Every night: number of recordings, each with all families.
RECORDINGS = int(os.environ.get("I2RIS_RECORDINGS", "0"))
COMPARED = [("gear", 1, family) for family in ("linear", "gmr", "gmr-play")] if not RECORDINGS else [
    (benchmark.PHYSICS[number % len(benchmark.PHYSICS)], 1 + number // len(benchmark.PHYSICS), family)
    for number in range(RECORDINGS)
    for family in ("linear", "gmr", "gmr-play", "force-balance", "best")
]  # fmt: skip


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return benchmark.Case("gear", 1, "short", folder=tmp_path_factory.mktemp("benchmark"))


@pytest.fixture(scope="module")
def train(case):
    return case.train()


def gru(units=8, seed=0):
    torch = pytest.importorskip("torch")
    torch.manual_seed(seed)
    return [torch.nn.GRU(2, units), torch.nn.Linear(units, 2)]


def learned(train, layers=None, **changes):
    """A network with the gain of the recording: what it has not learned is small."""
    gain, offset = benchmark.linear(train)
    options = {"step_counts": 20.0, "output_scale": (0.1, 0.1), "output_centre": offset, "skip_gain": gain}
    return from_torch(layers or gru(), **{**options, **changes})


def test_truncated_recording_of_an_earlier_run_is_refused(case, tmp_path):
    whole = case.train_path().read_bytes()
    (tmp_path / f"{case.name}.csv").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(RuntimeError, match="delete it"):
        benchmark.Case("gear", 1, "short", folder=tmp_path).train()


@pytest.mark.skipif(not CLI, reason="I2RIS_CLI does not name the command line")
@pytest.mark.parametrize(("physics", "seed", "family"), COMPARED)
def test_file_equals_that_of_the_command_line(physics, seed, family, tmp_path):
    path = benchmark.Case(physics, seed, "short", folder=tmp_path).train_path()
    options = ["--family", family, "--restarts", "2", "--components", "..3"]
    run = subprocess.run([CLI, "calibrate", "fit", path, "-o", tmp_path / "cli.json", *options], capture_output=True, text=True)
    try:
        Calibration(family, restarts=2, max_components=3).fit(path).save(tmp_path / "wheel.json")
    except ModelError as error:
        # Both refuse the same, with the same sentence except for the remedy.
        assert run.returncode != 0 and str(error).split(";")[0] in run.stderr, (str(error), run.stderr)
        return
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "wheel.json").read_bytes() == (tmp_path / "cli.json").read_bytes()


@pytest.mark.skipif(not CLI, reason="I2RIS_CLI does not name the command line")
def test_imported_network_equals_that_of_the_command_line(case, train, tmp_path):
    """Deviation and range are computed by the network itself: wide and narrow instructions give the same bits."""
    network = tmp_path / "gru.json"
    learned(train, gru(units=37), path=network)
    options = ["--robot-id", "i2ris", "--output", tmp_path / "cli.json"]
    run = subprocess.run([CLI, "model", "import", network, case.train_path(), *options], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    Model.from_network(network, case.train_path()).save(tmp_path / "wheel.json")
    assert (tmp_path / "wheel.json").read_bytes() == (tmp_path / "cli.json").read_bytes()


def test_arrays_lists_integers_frames_and_gaps_give_the_same_model(train, tmp_path):
    fit = Calibration("linear")
    with_arrays = fit.fit(train.t_s, train.counts, train.angles_deg).model_
    lists = fit.fit(train.t_s.tolist(), train.counts.astype(int).tolist(), train.angles_deg.tolist()).model_
    assert with_arrays.id == lists.id
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(np.column_stack([train.counts, train.angles_deg]), columns=["q0", "q1", "pitch", "yaw"])
    frames = fit.fit(train.t_s, frame[["q0", "q1"]], frame[["pitch", "yaw"]]).model_
    assert frames.id == with_arrays.id
    write_recording(tmp_path / "recording.csv", train.t_s, train.counts, train.angles_deg)
    assert fit.fit(tmp_path / "recording.csv").model_.id == with_arrays.id


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda t, c, a: (t, c[:-1], a), "rows"),
        (lambda t, c, a: (t, c[:, :1].repeat(3, axis=1), a), "rows of 1 or 2 numbers"),
        (lambda t, c, a: (t, [[1], [2, 3]], a), "rows of one length"),
        (lambda t, c, a: (t, [["a", "b"]], a), "must be numbers"),
        (lambda t, c, a: (t, np.where(c == c[7], np.nan, c), a), "row"),
        (lambda t, c, a: (t, np.zeros_like(c), a), "never moved"),
        (lambda t, c, a: (t[::-1].copy(), c, a), "time|t_s"),
        (lambda t, c, a: ([], np.zeros((0, 2)), np.zeros((0, 2))), "row"),
        (lambda t, c, a: (t, None, None), "path"),
    ],
)
def test_invalid_recordings_are_reported_in_a_sentence(train, change, sentence):
    with pytest.raises((TypeError, ValueError), match=sentence) as refused:
        Calibration("linear").fit(*change(train.t_s, train.counts, train.angles_deg))
    assert "\n" not in str(refused.value).strip()


class Frame:
    """What a frame of pandas or polars is for a fit."""

    def __init__(self, values, columns):
        self.values, self.columns = np.asarray(values), columns

    def __array__(self, dtype=None, copy=None):
        return self.values if dtype is None else self.values.astype(dtype)


def test_frame_columns_are_found_by_name_with_units(train, recwarn):
    fit = Calibration("linear")
    plain = fit.fit(train.t_s, train.counts, train.angles_deg).model_
    counts = Frame(train.counts[:, ::-1], ["q1_counts", "q0_counts"])
    angles = Frame(train.angles_deg[:, ::-1], ["yaw_deg", "pitch_deg"])
    assert fit.fit(train.t_s, counts, angles).model_.id == plain.id
    assert np.array_equal(plain.predict(counts), plain.predict(train.counts))
    for t_s, counts, angles, sentence in [
        (train.t_s, Frame(train.counts, ["left", "right"]), train.angles_deg, "call them q0_counts, q1_counts"),
        (train.t_s, train.counts, Frame(train.angles_deg, ["pitch_rad", "yaw_rad"]), "is in rad; pass degrees"),
        (Frame(train.t_s[:, np.newaxis], ["t_ms"]), train.counts, train.angles_deg, "is in ms; pass seconds"),
        (train.t_s, train.counts, np.where(train.angles_deg == train.angles_deg[0], np.inf, train.angles_deg), "row 0"),
    ]:
        with pytest.raises(ValueError, match=sentence):
            fit.fit(t_s, counts, angles)
    recwarn.clear()
    fit.fit(1000 * train.t_s, train.counts, np.radians(train.angles_deg))
    raised = " ".join(str(warning.message) for warning in recwarn)
    assert "if it is in ms; pass seconds" in raised and "radians" in raised, raised


def test_messages_name_no_temporary_files_or_options(train):
    back = train.t_s.copy()
    back[7] = back[6]
    wrapped = np.mod(train.counts, 65536)
    for t_s, counts, angles, sentence in [
        (back, train.counts, train.angles_deg, "recording of arrays, row 7, column `t_s`"),
        (train.t_s, wrapped, train.angles_deg, "jump by about 65536.*numpy.unwrap"),
        (train.t_s, train.counts, np.random.default_rng(1).normal(size=train.angles_deg.shape), "with force"),
    ]:
        with pytest.raises(ModelError, match=sentence) as refused:
            Calibration("linear").fit(t_s, counts, angles)
        assert "--" not in str(refused.value) and "/tmp" not in str(refused.value)
    Calibration("linear").fit(train.t_s, np.unwrap(wrapped, period=65536, axis=0), train.angles_deg)


def test_tracker_needs_one_finite_number_per_motor_and_angle(train):
    tracker = Calibration("linear").fit(train.t_s, train.counts, train.angles_deg).model_.tracker()
    for values in ([], [1.0], [1.0, 2.0, 3.0], [1.0, np.nan], [np.inf, 1.0]):
        for call in (tracker.advance, tracker.invert):
            with pytest.raises(ModelError, match="must be 2 finite"):
                call(values)
    tracker.advance([1.0, 2.0])
    assert np.isfinite(tracker.invert([1.0, 2.0])[0]).all()


def test_options_have_the_manners_of_scikit_learn(train):
    fit = Calibration("linear", robot_id="bench")
    assert Calibration(**fit.get_params()).get_params() == fit.get_params()
    with pytest.raises(ValueError, match="no option"):
        fit.set_params(colour="red")
    with pytest.raises(ModelError, match="not fitted"):
        fit.predict(train.counts)
    with pytest.raises(ModelError, match="not a model family"):
        Calibration("magic").fit(train.t_s, train.counts, train.angles_deg)
    fit.fit(train.t_s, train.counts, train.angles_deg)
    assert fit.model_.to_dict()["robot_id"] == "bench"
    assert fit.score(train.counts, train.angles_deg) > 0.9 and "model id" in fit.report()


def test_progress_is_reported_and_an_interrupt_ends_a_fit(train):
    calls = []

    def stop(name, share):
        calls.append((name, share))
        if share > 0.02:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Calibration("best", progress=stop).fit(train.t_s, train.counts, train.angles_deg)
    assert calls and all(0 <= share <= 1 for _, share in calls)


def test_the_inverse_comes_back_whole_and_tick_by_tick(train, tmp_path):
    import pickle

    fit = Calibration("linear", remove_latency=False).fit(train.t_s, train.counts, train.angles_deg)
    assert fit.report_["latency_taken_off_s"] == 0
    fit.save(tmp_path / "model.json")
    model = Model.load(tmp_path / "model.json")
    assert model.id == fit.model_.id == pickle.loads(pickle.dumps(model)).id
    turn = np.linspace(0, 6, 200)
    goal = 10 * np.column_stack([np.sin(turn), np.cos(turn)])
    counts = model.invert(goal, history=train.counts)
    found, deviations = model.predict(counts, return_std=True)
    assert np.abs(found - goal).max() < 0.05 and np.array_equal(found, model.predict(counts))
    assert deviations.shape == found.shape and (deviations > 0).all()
    tracker = model.tracker(train.counts)
    found, clipped = tracker.invert(list(goal[0]))
    assert not clipped and np.abs(np.round(found) - counts[0]).max() == 0
    with pytest.raises(ModelError, match="cannot read model file"):
        Model.load(tmp_path / "none.json")


def test_gru_lstm_and_convolutions_convert_from_torch_and_onnx(train, tmp_path):
    torch = pytest.importorskip("torch")
    pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    from torch import nn

    class Sequence(nn.Module):
        def __init__(self, layers):
            super().__init__()
            self.layers = nn.ModuleList(layers)

        def forward(self, values):
            for layer in self.layers:
                values = layer(values)
                values = values[0] if isinstance(values, tuple) else values
            return values

    path, taken = steps_by_travel(train.counts, 20.0)
    torch.manual_seed(1)
    gain, offset = benchmark.linear(train)
    recording = tmp_path / "recording.csv"
    write_recording(recording, train.t_s, train.counts, train.angles_deg)
    for name, layers, axes in [
        ("gru-64", [nn.GRU(2, 64), nn.Linear(64, 2)], (1, 0)),
        ("lstm-32", [nn.LSTM(2, 32), nn.Linear(32, 8), nn.Softplus(), nn.Linear(8, 2)], (1, 0)),
        ("conv", [nn.ConstantPad1d((4, 0), 0.0), nn.Conv1d(2, 8, 3, dilation=2), nn.ReLU(), nn.Conv1d(8, 2, 1)], (2, 0)),
    ]:
        module = Sequence(layers).eval()
        inputs = torch.tensor(path / 1000, dtype=torch.float32)
        inputs = inputs[:, None, :] if axes == (1, 0) else inputs.T[None]
        # The last layer learns what a straight line leaves over, by least squares.
        seen = np.isfinite(train.angles_deg).all(axis=1)
        with torch.no_grad():
            features = Sequence(layers[:-1])(inputs)
            features = (features[:, 0, :] if axes == (1, 0) else features[0].T).numpy()[taken[seen] - 1]
            wanted = (train.angles_deg[seen] - train.counts[seen] @ gain.T - offset) / 0.1
            table = np.column_stack([features, np.ones(len(features))])
            found = np.linalg.solve(table.T @ table + 1e-1 * np.eye(table.shape[1]), table.T @ wanted).T
            layers[-1].weight.copy_(torch.tensor(found[:, :-1]).reshape(layers[-1].weight.shape))
            layers[-1].bias.copy_(torch.tensor(found[:, -1]))
        file = tmp_path / f"{name}.onnx"
        torch.onnx.export(module, (inputs,), str(file), dynamo=False, input_names=["x"])
        outputs = runtime.InferenceSession(str(file)).run(None, {"x": inputs.numpy()})[0]
        outputs = outputs[:, 0, :] if axes == (1, 0) else outputs[0].T
        networks = [learned(train, layers), from_onnx(file, **options(train))]
        expected = 0.1 * outputs + offset + path @ gain.T
        for network in networks:
            model = Model.from_network(network, recording, hold_out="none")
            tracker = model.tracker(path[:1])
            found = []
            for before, row in zip(path, path[1:], strict=False):
                tracker.advance(list(row))
                found.append(tracker.predict())
                # A step is taken when the motors are beyond its end.
                tracker.advance(list(row + 1e-7 * (row - before)))
            difference = np.abs(np.array(found) - expected[1:]).max()
            print(f"{name}: {difference:.2e} deg from onnxruntime")
            assert difference < 1e-5, name


def options(train):
    gain, offset = benchmark.linear(train)
    return {"step_counts": 20.0, "output_scale": (0.1, 0.1), "output_centre": offset, "skip_gain": gain}


@pytest.mark.parametrize("kind", ["float16", "nan", "attention", "beta", "two ways", "pad", "layers"])
def test_networks_that_are_not_known_are_refused_by_name(kind, train):
    torch = pytest.importorskip("torch")
    from torch import nn

    layers = gru()
    sentence = {
        "float16": "float16", "nan": "not finite", "attention": "MultiheadAttention", "beta": "beta", "two ways":
        "bidirectional", "pad": "causal", "layers": "GELU",
    }[kind]  # fmt: skip
    if kind == "float16":
        layers[0].half()
    elif kind == "nan":
        with torch.no_grad():
            layers[1].weight[0, 0] = float("nan")
    else:
        other = {
            "attention": lambda: nn.MultiheadAttention(2, 1), "beta": lambda: nn.Softplus(beta=2.0),
            "two ways": lambda: nn.GRU(2, 4, bidirectional=True), "pad": lambda: nn.Conv1d(2, 2, 3, padding=1),
            "layers": nn.GELU,
        }[kind]()  # fmt: skip
        layers.append(other)
    with pytest.raises(ModelError, match=sentence):
        learned(train, layers)


def test_networks_of_other_recordings_are_refused_early(case, train, tmp_path):
    path = case.train_path()
    gain, offset = benchmark.linear(train)
    for change, sentence in [
        ({"skip_gain": np.radians(gain), "output_centre": np.radians(offset)}, "straight line|unusable"),
        ({"unit": "rad"}, "unknown variant `rad`"),
        ({"outputs": ("yaw", "pitch")}, "train it on those columns"),
        ({"step_counts": 0.1}, "step_counts"),
        ({"output_scale": (1e9, 1e9)}, "10000"),
    ]:
        with pytest.raises(ModelError, match=sentence):
            Model.from_network(learned(train, **change), path)
    short = tmp_path / "short.csv"
    write_recording(short, train.t_s[:2000], train.counts[:2000], train.angles_deg[:2000])
    with pytest.raises(ModelError, match="steps of 900 counts"):
        Model.from_network(learned(train, step_counts=900.0), short)
    inverse = learned(train)
    inverse["inputs"] = ["pitch_deg", "yaw_deg"]
    with pytest.raises(ModelError, match="from counts to angles"):
        Model.from_network(inverse, path)
    huge = tmp_path / "huge.json"
    with huge.open("wb") as file:
        file.truncate(1 << 30)
    with pytest.raises(ModelError, match="1024 MB"):
        Model.from_network(huge, path)
    with pytest.raises(ModelError, match="1024 MB"):
        Model.load(huge)
    with pytest.raises(ModelError, match="1024 MB"):
        from_onnx(huge, step_counts=20.0)


def test_the_benchmark_scores_and_its_data_are_frozen(case):
    train, test = case.train(), case.test()
    gain, offset = benchmark.linear(train)
    assert benchmark.forward(case, lambda counts: counts @ gain.T + offset) == pytest.approx(1.0)
    assert np.isfinite(test.angles_deg).any() and test.sha256 != train.sha256
    frozen = benchmark.digests()
    assert frozen[case.name] == train.sha256
    kinds = len(benchmark.PROTOCOLS) * len(benchmark.CAMERAS) + 2
    assert len(frozen) == len(benchmark.PHYSICS) * len(benchmark.SEEDS) * kinds
    with pytest.raises(ValueError, match="none of version 3"):
        benchmark.Case("glue")


def test_an_aged_snake_is_judged_on_what_was_trained_before(case):
    aged = benchmark.Case("gear", 1, "short", aged=True, folder=case.folder)
    assert aged.train().sha256 == case.train().sha256 and aged.test().sha256 != case.test().sha256
    assert benchmark.digests()["gear-1-aged"] == aged.test().sha256
    fit = Calibration("gmr-play", restarts=2, max_components=3, robot_id="i2ris-emulated").fit(case.train_path())
    new, aged = (benchmark.inverse(each, fit.model_)["circle"] for each in (case, aged))
    assert aged["linear_deg"] > 1.05 * new["linear_deg"] and aged["exact_deg"] < 0.5 * aged["rms_deg"]


def test_a_snake_that_creeps_asks_for_times(tmp_path):
    content = json.loads((Path(__file__).parents[3] / "tests" / "adaptation" / "force-balance.json").read_text())
    counts = np.column_stack([np.linspace(0, 1000, 50)] * 2)
    angles = []
    for creep in ([0.0, 0.0, 0.0], [0.05, 0.05, 0.0]):
        content["family"]["balance"]["creep"] = creep
        (tmp_path / "model.json").write_text(json.dumps(content))
        model = Model.load(tmp_path / "model.json")
        with warnings.catch_warnings(record=True) as raised:
            warnings.simplefilter("always")
            angles.append(model.predict(counts, t_s=np.arange(50.0)))
            assert not raised
            model.predict(counts)
            assert [str(each.message)[:5] for each in raised] == ["t_s: "] * any(creep)
    assert np.abs(angles[0] - angles[1]).max() > 0.1


def test_the_textbook_operator_runs_as_a_model(case):
    model = prandtl_ishlinskii.fit(case.train_path(), "i2ris-emulated")
    assert benchmark.forward(case, model.predict) < 0.9
    assert benchmark.geometric_mean(found["share"] for found in benchmark.inverse(case, model).values()) < 1.0


def test_the_published_method_gives_the_figure_of_the_table(case):
    rows = json.loads((Path(__file__).parents[2] / "manual" / "src" / "benchmark.json").read_text())
    wanted = {"physics": "gear", "seed": 1, "protocol": "short", "camera": "usual", "method": "gmr-direction"}
    (row,) = (row for row in rows if all(row[key] == value for key, value in wanted.items()) and not row.get("aged"))
    model = gmr_direction.fit(case.train_path(), "i2ris-emulated")
    assert benchmark.forward(case, model.predict) == pytest.approx(row["forward"], rel=1e-3)


def test_the_table_takes_results_of_others_and_draws_them(tmp_path, monkeypatch):
    def row(method, seed, forward):
        return {
            "version": 3, "physics": "gear", "seed": seed, "protocol": "reversals", "camera": "usual", "method": method,
            "forward": forward, "inverse": 2 * forward, "exact": 0.01 * seed**2,
        }  # fmt: skip

    theirs, refused = tmp_path / "theirs.json", {**row("odd", 1, 0.3), "refused": "it folds"}
    del refused["forward"], refused["inverse"]
    # Limits were others then, and so was the inverse task.
    old = {**row("theirs", 1, 0.1), "version": 2, "inverse": 0.9}
    old_only = {**row("old", 1, 0.5), "version": 2}
    theirs.write_text(json.dumps([row("theirs", 1, 0.1), old, row("theirs", 2, 0.4), refused, old_only]))
    files = [tmp_path / name for name in ("all.json", "page.md", "figure.svg")]
    options = ["--families", "--results", theirs, "--json", files[0], "--page", files[1], "--figure", files[2]]
    monkeypatch.setattr(sys, "argv", ["benchmark_table", *map(str, options)])
    benchmark_table.main()
    page = files[1].read_text()
    assert "| theirs | 0.200 | 0.200 |" in page and "| theirs | 0.400 | 0.400 |" in page and "| odd (seed 1) | - | - |" in page, page
    assert "| old (seed 1) | 0.500 | 0.500 |" in page and "| old (seed 1) | 1.000" not in page, page
    assert "| exact | 0.020 |" in page and "odd, gear 1: it folds" in page
    assert files[2].read_text().startswith("<svg") and json.loads(files[0].read_text())[0]["method"] == "theirs"


def test_the_table_of_the_manual_is_that_of_the_results():
    folder = Path(__file__).resolve().parents[2] / "manual" / "src"
    text = (folder / "evidence.md").read_text()
    head, rest = text.split("<!-- benchmark:")
    mark, rest = rest.split("-->\n\n", 1)
    table, tail = rest.split("\n<!-- end -->", 1)
    wanted = benchmark_table.summary(json.loads((folder / "benchmark.json").read_text()))
    if os.environ.get("I2RIS_UPDATE"):
        (folder / "evidence.md").write_text(f"{head}<!-- benchmark:{mark}-->\n\n{wanted}\n<!-- end -->{tail}")
    else:
        assert table == wanted, "run I2RIS_UPDATE=1 python -m pytest tools/python/tests/test_model.py -k manual"


def test_a_public_recording_is_known_by_its_hash(tmp_path):
    copy = tmp_path / "copy.csv"
    copy.write_text("something else")
    with pytest.raises(ValueError, match="is not the file of garyduu901"):
        public.load("i2ris-circle", file=copy)
    with pytest.raises(ValueError, match="is not known"):
        public.load("glue")
    there = Path(__file__).resolve().parents[3].parent / "shared" / "data" / "i2ris" / "output_w_angles.csv"
    if not there.exists():
        pytest.skip("the recording is missing")
    recording = public.load("i2ris-circle", file=there)
    assert recording.counts[0].tolist() == [257, -237] and recording.angles_deg[0, 1] == pytest.approx(-2.5667, abs=1e-4)
    Calibration("linear").fit(recording.t_s, recording.counts, recording.angles_deg)


def test_gymnasium_knows_the_environment_and_checks_it():
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    import i2ris.reach

    i2ris.reach.register()
    env = gymnasium.make("i2ris/Reach-v0", physics="gear", snake=2)
    check_env(env.unwrapped, skip_render_check=True)
    first, _ = env.reset(seed=3)
    again, _ = env.reset(seed=3)
    assert (first == again).all()


def test_importing_is_quick_to_write():
    """No time is asserted; nothing heavy is imported."""
    text = "import sys, i2ris.model; print(sorted(set(sys.modules) & {'torch', 'onnx', 'pandas', 'gymnasium', 'cv2'}))"
    found = subprocess.run([sys.executable, "-c", text], check=True, capture_output=True, text=True)
    assert found.stdout.strip() == "[]"


def test_the_notebook_of_the_published_method_runs(tmp_path, capsys):
    """On one snake, and without the default family, which takes the time of all others."""
    pytest.importorskip("matplotlib").use("Agg")
    notebook = json.loads((Path(__file__).parents[1] / "examples" / "published_method.ipynb").read_text())
    names: dict = {"SNAKES": ("steel",), "FOLDER": str(tmp_path), "RESTARTS": 4}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            source = "".join(cell["source"]).replace(', ("i2ris (best)", "best", None)', "")
            exec(compile(source, "published_method.ipynb", "exec"), names)
    rows = [line.split(" | ") for line in capsys.readouterr().out.splitlines() if line.count("|") == 10]
    error = {row[1]: float(row[6]) for row in rows if row[0] == "| `steel`"}
    assert len(error) == 8 and error["gmr-play"] < 0.5 * error["linear"] < 1.0
    assert error["gmr by direction, K = 3"] < 0.5 * error["gmr, K = 3"]
    assert all((tmp_path / f"published-{name}.png").stat().st_size > 0 for name in ("loops", "mixture"))


@pytest.mark.skipif(not CLI, reason="I2RIS_CLI does not name the command line")
def test_the_notebook_runs(tmp_path, monkeypatch):
    """Record, fit, use, circle, plot: its cells, one after the other, with an emulated robot."""
    pytest.importorskip("iceoryx2", reason="the client is not installed: pip install 'tools/python[client]'")
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(Path(CLI).parent), prepend=os.pathsep)
    notebook = json.loads((Path(__file__).parents[1] / "examples" / "tracked_circle.ipynb").read_text())
    names: dict = {"DOMAIN": f"notebook-{os.getpid()}", "SECONDS": 60, "RESTARTS": 2}
    words = [CLI, "start", "--no-monitor", "--folder", "robot", "--domain", names["DOMAIN"]]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as robot:
        try:
            assert robot.stdout.readline().startswith("ready")
            for cell in notebook["cells"]:
                if cell["cell_type"] == "code":
                    exec(compile("".join(cell["source"]), "tracked_circle.ipynb", "exec"), names)
        finally:
            robot.send_signal(signal.SIGINT)
    assert names["rms_deg"] < 2.0 and Path("circle.png").stat().st_size > 0
