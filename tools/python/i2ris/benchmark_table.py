"""The table of the benchmark: fits, judges, and writes the results as JSON and as a page.

    python -m i2ris.benchmark_table --networks gru=networks/gru tcn=networks/tcn \\
        --json results.json --page benchmark.md --figure benchmark.svg

Results by others: a JSON file of the same form (``--results FILE``), a row for each case and method. Without
``--families`` and ``--networks`` nothing is run, and page and figure are made of the results alone.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from i2ris import benchmark, gmr_direction, prandtl_ishlinskii
from i2ris.benchmark import Floats
from i2ris.model import Calibration, Model, ModelError

Row = dict[str, Any]


def judge(case: benchmark.Case, method: str, folder: Path | None) -> Row:
    """One row: a family fitted here, or a model or network from a folder with PHYSICS-SEED.json."""
    row: Row = {
        "version": benchmark.VERSION, "physics": case.physics, "seed": case.seed, "protocol": case.protocol,
        "camera": case.camera, "aged": case.aged, "method": method,
    }  # fmt: skip
    try:
        model: Model | gmr_direction.DirectionModel
        if method == "gmr-direction":
            model = gmr_direction.fit(case.train_path(), "i2ris-emulated")
        elif method == "prandtl-ishlinskii":
            model = prandtl_ishlinskii.fit(case.train_path(), "i2ris-emulated")
        elif folder is None:
            model = Calibration(method, robot_id="i2ris-emulated").fit(case.train_path()).model_
        else:
            path = folder / f"{case.physics}-{case.seed}.json"
            is_network = json.loads(path.read_text()).get("format") == "i2ris-network"
            model = Model.from_network(path, case.train_path(), robot_id="i2ris-emulated") if is_network else Model.load(path)
        row["model"] = model.to_dict()["family"]["kind"]
        row["forward"] = benchmark.forward(case, at_times(case, model))
        motions = benchmark.inverse(case, model) if isinstance(model, Model) else gmr_direction.inverse(case, model)
        row["motions"] = motions
        row["inverse"] = benchmark.geometric_mean(found["share"] for found in motions.values())
        row["exact"] = benchmark.geometric_mean(found["exact_deg"] / found["linear_deg"] for found in motions.values())
    except (ModelError, OSError) as error:
        row["refused"] = str(error)
    return row


def at_times(case: benchmark.Case, model: Model | gmr_direction.DirectionModel) -> Callable[[Floats], ArrayLike]:
    """Angles from the counts of the test, for a snake that creeps at their times."""
    if isinstance(model, Model):
        return lambda counts: model.predict(counts, t_s=case.test().t_s)
    return model.predict


def of_task(rows: Iterable[Row], task: str) -> list[Row]:
    """The rows for the present task; of several with the same case and method, the newest."""
    newest: dict[tuple[Any, ...], Row] = {}
    for row in sorted(rows, key=lambda row: row["version"]):
        if task == "forward" or row["version"] >= benchmark.INVERSE_SINCE:
            newest[row["physics"], row["seed"], *kind(row), row["method"]] = row
    return list(newest.values())


def shares(rows: Iterable[Row], physics: str, method: str, task: str) -> list[float]:
    """The shares of a method on a physics; none where any of them was refused."""
    of = [row for row in rows if row["physics"] == physics]
    if method == "exact":
        return list({row["seed"]: row["exact"] for row in of if "exact" in row}.values())
    of = [row for row in of if row["method"] == method]
    return [row[task] for row in of] if all(task in row for row in of) else []


def own_seeds(rows: list[Row], method: str) -> str:
    """Note on the seeds of a method if they differ from those of all rows."""
    seeds = {row["seed"] for row in rows if row["method"] == method}
    if not seeds or seeds == {row["seed"] for row in rows}:
        return ""
    return f" (seed{'s' * (len(seeds) > 1)} {', '.join(map(str, sorted(seeds)))})"


def table(rows: list[Row], task: str) -> list[str]:
    """Methods by physics; those with different seeds are marked."""
    rows = of_task(rows, task)
    physics = [name for name in benchmark.PHYSICS if any(row["physics"] == name for row in rows)]
    methods = list(dict.fromkeys(row["method"] for row in rows)) + ["exact"] * (task == "inverse")
    lines = [f"| method | {' | '.join(physics)} | all |", "|---" * (len(physics) + 2) + "|"]
    lines.append(f"| linear | {'1 | ' * len(physics)}1 |")
    for method in methods:
        found = [shares(rows, name, method, task) for name in physics]
        cells = [f"{benchmark.geometric_mean(cell):.3f}" if cell else "-" for cell in found]
        every = [share for cell in found for share in cell]
        whole = f"{benchmark.geometric_mean(every):.3f}" if every and all(found) else "-"
        lines.append(f"| {method}{own_seeds(rows, method)} | {' | '.join(cells)} | {whole} |")
    return lines


def kind(row: Row) -> tuple[str, str, bool]:
    """Protocol, camera and ageing of the snake: each combination has its own tables."""
    return row["protocol"], row["camera"], row.get("aged", False)


#: Columns of the one table and their rows: the usual case first, then harder ones.
CASES = (
    ("300 s", ("reversals", "usual", False)),
    ("100 s", ("short", "usual", False)),
    ("late camera", ("reversals", "late", False)),
    ("noisy camera", ("reversals", "noisy", False)),
    ("one axis at a time", ("axes", "usual", False)),
    ("strokes of both axes", ("joint", "usual", False)),
    ("aged, no camera", ("reversals", "usual", True)),
)


def summary(rows: Iterable[Row]) -> str:
    """One table: every method in every case, over all physics that it was run on (`of` their number if not all), with its
    worst physics."""
    every = list(rows)
    methods = [*dict.fromkeys(row["method"] for row in every), "exact"]
    lines = [f"| task | method | {' | '.join(name for name, _ in CASES)} |", "|---" * (len(CASES) + 2) + "|"]
    for task in ("inverse", "forward"):
        rows = of_task(every, task)
        for method in methods[: len(methods) - (task == "forward")]:
            cells = []
            for _, case in CASES:
                of = [row for row in rows if kind(row) == case]
                found = {name: shares(of, name, method, task) for name in benchmark.PHYSICS}
                run = {row["physics"] for row in of if row["method"] == method or method == "exact"}
                if not run or not all(found[name] for name in run):
                    cells.append("-")
                    continue
                share, name = max((benchmark.geometric_mean(found[name]), name) for name in run)
                whole = benchmark.geometric_mean(share for cell in found.values() for share in cell)
                fewer = f" of {len(run)}" if len(run) < len(benchmark.PHYSICS) else ""
                cells.append(f"{whole:.3f}{fewer} ({name} {share:.3f})")
            usual = [row for row in rows if kind(row) == CASES[0][1]]
            lines.append(f"| {task} | {method}{own_seeds(usual, method)} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def page(rows: Iterable[Row], note: str = "") -> str:
    """The tables as Markdown: geometric means over seeds, for each method and physics."""
    rows = list(rows)
    lines = [
        "# The hysteresis benchmark, version 3",
        "",
        "Share of a straight line's error, geometric mean over the seeds; **forward** (angles from counts, after 10 s)",
        "and **inverse** (tip while the controller tracks five motions). `exact` is the inverse of the snake itself",
        "within the same limits of the motors. `-`: refused, or the robot did not follow. Written by",
        "`python -m i2ris.benchmark_table`; how to take part: the chapter Python of the manual.",
        *(["", note.strip()] if note else []),
    ]
    for protocol, camera, aged in sorted({kind(row) for row in rows}, key=lambda key: (key[2], key[1] != "usual", key)):
        chosen = [row for row in rows if kind(row) == (protocol, camera, aged)]
        seeds = sorted({row["seed"] for row in chosen})
        for task in ("forward", "inverse"):
            title = f"{protocol}, {camera} camera{', the snake has aged' if aged else ''}: {task}"
            lines += ["", f"## {title[0].upper()}{title[1:]}", "", f"Seeds {', '.join(map(str, seeds))}.", ""]
            lines += table(chosen, task)
    refused = [row for row in rows if "refused" in row]
    if refused:
        lines += ["", "## Refused", ""]
        lines += [f"- {row['method']}, {row['physics']} {row['seed']}: {row['refused']}" for row in refused]
    return "\n".join(lines) + "\n"


#: Families among which `best` chooses.
FAMILIES = ("linear", "gmr", "gmr-play", "force-balance")


def regret(rows: Iterable[Row]) -> list[tuple[float, Row]]:
    """Error of the choice of `best` divided by that of the best family in hindsight, largest first, with the row."""
    cases: dict[tuple[Any, ...], dict[str, Row]] = {}
    for row in of_task(rows, "inverse"):
        cases.setdefault((row["physics"], row["seed"], *kind(row)), {})[row["method"]] = row
    found = []
    for case in cases.values():
        families = [case[name]["inverse"] for name in FAMILIES if "inverse" in case.get(name, {})]
        if families and "inverse" in case.get("best", {}):
            found.append((case["best"]["inverse"] / min(families), case["best"]))
    return sorted(found, key=lambda pair: -pair[0])


#: Methods of the figure, with their names and colours.
SHOWN = (
    ("linear", "straight line", "#9aa0a6"),
    ("gmr-direction", "GMR by direction, published", "#e08214"),
    ("gmr-play", "plays and GMR", "#8073ac"),
    ("best", "i2ris", "#1b9e77"),
)


def figure(rows: Iterable[Row]) -> str:
    """Bars of the inverse task by physics, as SVG for light and dark backgrounds."""
    rows = [row for row in of_task(rows, "inverse") if kind(row) == ("reversals", "usual", False)]
    width, height, left, bottom, bar = 880, 314, 46, 250, 18
    names = [name for name in benchmark.PHYSICS if any(row["physics"] == name for row in rows)] or benchmark.PHYSICS
    step = (width - left - 10) / len(names)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13" fill="#80868b">',
        f'<text x="{left}" y="14">Error of the tip while it follows unseen motion, share of a straight line\'s</text>',
    ]
    for tick in range(0, 11, 2):
        y = bottom - 20 * tick
        lines.append(f'<path d="M{left} {y}H{width - 10}" stroke="#80868b" stroke-opacity="0.3"/>')
        lines.append(f'<text x="{left - 6}" y="{y + 4}" text-anchor="end">{tick / 10:.1f}</text>')
    for number, physics in enumerate(names):
        begin = left + number * step + (step - bar * len(SHOWN)) / 2
        for line, word in enumerate(physics.split("-", 1)):
            x = left + (number + 0.5) * step
            lines.append(f'<text x="{x:.0f}" y="{bottom + 18 + 14 * line}" text-anchor="middle">{word}</text>')
        for place, (method, _, colour) in enumerate(SHOWN):
            found = [1.0] if method == "linear" else shares(rows, physics, method, "inverse")
            x = begin + place * bar
            if not found:
                lines.append(f'<text x="{x + bar / 2:.0f}" y="{bottom - 4}" text-anchor="middle">-</text>')
                continue
            share = benchmark.geometric_mean(found)
            tall = 200 * min(share, 1.08)
            lines.append(f'<rect x="{x:.1f}" y="{bottom - tall:.1f}" width="{bar - 2}" height="{tall:.1f}" fill="{colour}"/>')
    for place, (method, name, colour) in enumerate(SHOWN):
        name += own_seeds(rows, method)
        x = left + place * 220
        lines.append(f'<rect x="{x}" y="{height - 18}" width="12" height="12" fill="{colour}"/>')
        lines.append(f'<text x="{x + 18}" y="{height - 7}">{name}</text>')
    return "\n".join([*lines, "</svg>"]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--physics", nargs="*", default=benchmark.PHYSICS)
    parser.add_argument("--seeds", nargs="*", type=int, default=benchmark.SEEDS)
    parser.add_argument("--protocols", nargs="*", default=tuple(benchmark.PROTOCOLS))
    parser.add_argument("--cameras", nargs="*", default=("usual",))
    parser.add_argument("--aged", action="store_true", help="judge on the snake after use")
    families = ("gmr", "gmr-direction", "prandtl-ishlinskii", "best")
    parser.add_argument("--families", nargs="*", default=families)
    parser.add_argument("--networks", nargs="*", default=(), metavar="NAME=FOLDER")
    parser.add_argument("--results", nargs="*", type=Path, default=(), help="results of others, in the format of --json")
    parser.add_argument("--folder", type=Path, help="folder for recordings")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--page", type=Path)
    parser.add_argument("--note", default="", help="note for the page of this run")
    parser.add_argument("--figure", type=Path)
    arguments = parser.parse_args()
    methods: list[tuple[str, Path | None]] = [(family, None) for family in arguments.families]
    methods += [(name, Path(folder)) for name, _, folder in (text.partition("=") for text in arguments.networks)]
    rows: list[Row] = [row for file in arguments.results for row in json.loads(file.read_text())]
    for case in benchmark.cases(arguments.physics, arguments.seeds, arguments.protocols, arguments.cameras, arguments.folder, arguments.aged):
        for method, folder in methods:
            row = judge(case, method, folder)
            rows.append(row)
            shown = row.get("refused") or f"forward {row['forward']:.3f}, inverse {row['inverse']:.3f}"
            print(f"{case.name}{' aged' * case.aged} {method}: {shown}", flush=True)
            arguments.json.write_text(json.dumps(rows, indent=1) + "\n")
    arguments.json.write_text(json.dumps(rows, indent=1) + "\n")
    for share, row in regret(rows)[:5]:
        where = f"{row['physics']} {row['seed']}, {row['protocol']}, {row['camera']} camera{', aged' * row.get('aged', False)}"
        print(f"regret {share:.2f}: {where}, took {row['model']}")
    if arguments.page:
        arguments.page.write_text(page(rows, arguments.note))
    if arguments.figure:
        arguments.figure.write_text(figure(rows))


if __name__ == "__main__":
    main()
