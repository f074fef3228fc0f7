"""The table of the benchmark: fits, judges, and writes the results as JSON and as a page.

    python -m i2ris.benchmark_table --families gmr gmr-direction best --networks gru=networks/gru tcn=networks/tcn \\
        --json results.json --page benchmark.md

Results by others: a JSON file of the same form (``--results FILE``), a row for each case and method.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from i2ris import benchmark
from i2ris.model import Calibration, Model, ModelError

Row = dict[str, Any]


def judge(case: benchmark.Case, method: str, folder: Path | None) -> Row:
    """One row: a family fitted here, or a model or network from a folder with PHYSICS-SEED.json."""
    row: Row = {
        "version": benchmark.VERSION, "physics": case.physics, "seed": case.seed, "protocol": case.protocol,
        "camera": case.camera, "method": method,
    }  # fmt: skip
    try:
        if folder is None:
            model = Calibration(method, robot_id="i2ris-emulated").fit(case.train_path()).model_
        else:
            path = folder / f"{case.physics}-{case.seed}.json"
            is_network = json.loads(path.read_text()).get("format") == "i2ris-network"
            model = Model.from_network(path, case.train_path(), robot_id="i2ris-emulated") if is_network else Model.load(path)
        row["model"] = model.to_dict()["family"]["kind"]
        row["forward"] = benchmark.forward(case, model.predict)
        motions = benchmark.inverse(case, model)
        row["motions"] = motions
        row["inverse"] = benchmark.geometric_mean(found["share"] for found in motions.values())
        row["exact"] = benchmark.geometric_mean(found["exact_deg"] / found["linear_deg"] for found in motions.values())
    except (ModelError, OSError) as error:
        row["refused"] = str(error)
    return row


def page(rows: Iterable[Row]) -> str:
    """The table as Markdown: geometric means over seeds, for each method and physics."""
    rows = list(rows)
    lines = [
        "# The hysteresis benchmark, version 1",
        "",
        "Share of a straight line's error, geometric mean over the seeds; **forward** (angles from counts, after 10 s)",
        "and **inverse** (tip while the controller tracks five motions). `exact` is the inverse of the snake itself",
        "within the same limits of the motors. `-`: refused, or the robot did not follow. Written by",
        "`python -m i2ris.benchmark_table`; how to take part: [Models from Python](python.md#the-benchmark).",
    ]
    kinds = sorted({(row["protocol"], row["camera"]) for row in rows})
    for protocol, camera in kinds:
        chosen = [row for row in rows if (row["protocol"], row["camera"]) == (protocol, camera)]
        physics = [name for name in benchmark.PHYSICS if any(row["physics"] == name for row in chosen)]
        seeds = sorted({row["seed"] for row in chosen})
        methods = list(dict.fromkeys(row["method"] for row in chosen))
        for task in ("forward", "inverse"):
            lines += ["", f"## {protocol}, {camera} camera: {task}", "", f"Seeds {', '.join(map(str, seeds))}.", ""]
            lines += [f"| method | {' | '.join(physics)} | all |", "|---" * (len(physics) + 2) + "|"]
            names = [*methods, "exact"] if task == "inverse" else methods
            for method in names:
                cells, every = [], []
                for name in physics:
                    of = [row for row in chosen if row["physics"] == name]
                    if method == "exact":
                        shares = [row["exact"] for row in of if "exact" in row][:1]
                    else:
                        of = [row for row in of if row["method"] == method]
                        shares = [row[task] for row in of if task in row] if all(task in row for row in of) else []
                    cells.append(f"{benchmark.geometric_mean(shares):.3f}" if shares else "-")
                    every += shares
                whole = f"{benchmark.geometric_mean(every):.3f}" if every and "-" not in cells else "-"
                lines.append(f"| {method} | {' | '.join(cells)} | {whole} |")
    refused = [row for row in rows if "refused" in row]
    if refused:
        lines += ["", "## Refused", ""]
        lines += [f"- {row['method']}, {row['physics']} {row['seed']}: {row['refused']}" for row in refused]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--physics", nargs="*", default=benchmark.PHYSICS)
    parser.add_argument("--seeds", nargs="*", type=int, default=benchmark.SEEDS)
    parser.add_argument("--protocols", nargs="*", default=tuple(benchmark.PROTOCOLS))
    parser.add_argument("--cameras", nargs="*", default=("usual",))
    parser.add_argument("--families", nargs="*", default=("gmr", "gmr-direction", "best"))
    parser.add_argument("--networks", nargs="*", default=(), metavar="NAME=FOLDER")
    parser.add_argument("--results", nargs="*", type=Path, default=(), help="results of others, as --json writes them")
    parser.add_argument("--folder", type=Path, help="where recordings are kept")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--page", type=Path)
    arguments = parser.parse_args()
    methods: list[tuple[str, Path | None]] = [(family, None) for family in arguments.families]
    methods += [(name, Path(folder)) for name, _, folder in (text.partition("=") for text in arguments.networks)]
    rows: list[Row] = [row for file in arguments.results for row in json.loads(file.read_text())]
    for case in benchmark.cases(arguments.physics, arguments.seeds, arguments.protocols, arguments.cameras, arguments.folder):
        for method, folder in methods:
            row = judge(case, method, folder)
            rows.append(row)
            shown = row.get("refused") or f"forward {row['forward']:.3f}, inverse {row['inverse']:.3f}"
            print(f"{case.name} {method}: {shown}", flush=True)
            arguments.json.write_text(json.dumps(rows, indent=1) + "\n")
    if arguments.page:
        arguments.page.write_text(page(rows))


if __name__ == "__main__":
    main()
