"""Trains the GRU and the TCN of the benchmark on the rows of a recording, and writes them for ``i2ris``.

    python train_networks.py FOLDER --physics preisach --seeds 1 --protocol reversals --minutes 2

writes ``FOLDER/gru/PHYSICS-SEED.json`` and ``FOLDER/tcn/...`` (for ``i2ris benchmark --models gru=FOLDER/gru``) and
beside each its training curve. Both learn what a straight line leaves over, on exactly what the controller does: a row
is one step from the hidden state after the steps before it. The rows that `i2ris calibrate fit` would hold out are
validation, and the best epoch on them is kept.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn

from i2ris import benchmark
from i2ris.convert import from_torch
from i2ris.model import walk

STEP_COUNTS = 20.0
CHUNK = 160
WARM = 60


class Gru(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.cell, self.out = nn.GRU(2, 64), nn.Linear(64, 2)

    def layers(self):
        return [self.cell, self.out]

    def rows(self, steps, rows, before):
        """``steps``: (T, B, 2); ``rows``: (R, B, 2), each after ``before`` (R, B) steps."""
        hidden = torch.cat([torch.zeros(1, steps.shape[1], 64), self.cell(steps)[0]])
        picked = hidden.gather(0, before[..., None].expand(-1, -1, 64)).reshape(1, -1, 64)
        return self.out(self.cell(rows.reshape(1, -1, 2), picked)[0][0]).reshape(rows.shape)


class Tcn(nn.Module):
    """Causal convolutions of three taps, 1, 2, 4 and 8 steps apart: 30 steps of the past."""

    WIDTH, DILATIONS = 12, (1, 2, 4, 8)
    PAST = 2 * sum(DILATIONS)

    def __init__(self) -> None:
        super().__init__()
        parts, inputs = [], 2
        for dilation in self.DILATIONS:
            parts += [nn.ConstantPad1d((2 * dilation, 0), 0.0), nn.Conv1d(inputs, self.WIDTH, 3, dilation=dilation), nn.Tanh()]
            inputs = self.WIDTH
        self.convs, self.out = nn.Sequential(*parts), nn.Linear(self.WIDTH, 2)

    def layers(self):
        return [*self.convs, self.out]

    def rows(self, steps, rows, before):
        padded = torch.cat([torch.zeros(self.PAST, steps.shape[1], 2), steps])
        index = before[None] + torch.arange(self.PAST)[:, None, None]
        count, batch = before.shape
        lanes = torch.arange(batch).expand(self.PAST, count, batch)
        window = torch.cat([padded[index, lanes], rows[None]]).reshape(self.PAST + 1, -1, 2)
        # Only the last value is wanted: pad nothing, and the convolutions shorten the window to it.
        values = window.permute(1, 2, 0)
        for part in self.convs:
            values = values if isinstance(part, nn.ConstantPad1d) else part(values)
        return self.out(values[..., 0]).reshape(rows.shape)


def train(network, steps, rows, before, targets, held_out, minutes: float, seed: int):
    """The network of the best epoch on the rows held out, and the curve."""
    torch.manual_seed(seed)
    generator = np.random.default_rng(seed)
    begins = np.arange(0, max(1, len(steps) - WARM), CHUNK)
    first = np.searchsorted(before, begins + WARM)
    last = np.searchsorted(before, begins + WARM + CHUNK)
    longest = int((last - first).max())
    pick = np.minimum(first[:, None] + np.arange(longest), np.maximum(last - 1, 0)[:, None])
    real = np.arange(longest)[None] < (last - first)[:, None]
    reach = np.minimum(begins[:, None] + np.arange(WARM + CHUNK), len(steps) - 1)
    chunks = torch.tensor(steps[reach]).transpose(0, 1)
    inputs, wanted = (torch.tensor(table[pick]).transpose(0, 1) for table in (rows, targets))
    local = torch.tensor(np.clip(before[pick] - begins[:, None], 0, WARM + CHUNK)).transpose(0, 1)
    judged = torch.tensor(real & held_out[pick]).transpose(0, 1)
    learned = torch.tensor(real & ~held_out[pick]).transpose(0, 1)
    best, curve, kept = float("inf"), [], None
    optimiser = torch.optim.Adam(network.parameters(), lr=4e-3)
    begun, epoch = time.monotonic(), 0
    while (share := (time.monotonic() - begun) / (60 * minutes)) < 1:
        for group in optimiser.param_groups:
            group["lr"] = 4e-3 * 0.5 * (1 + np.cos(np.pi * min(share, 1))) + 2e-5
        for batch in np.array_split(generator.permutation(len(begins)), max(1, len(begins) // 16)):
            found = network.rows(chunks[:, batch], inputs[:, batch], local[:, batch])
            loss = ((found - wanted[:, batch]) ** 2).sum(-1)[learned[:, batch]].mean()
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
        with torch.no_grad():
            error = ((network.rows(chunks, inputs, local) - wanted) ** 2).sum(-1)
            train_error, error = (float(error[part].mean().sqrt()) for part in (learned, judged))
        curve.append([epoch, train_error, error])
        epoch += 1
        if error < best:
            best, kept = error, {name: value.clone() for name, value in network.state_dict().items()}
    network.load_state_dict(kept)
    return curve


def prepare(recording: benchmark.Recording):
    """Steps, rows, steps before each row, residuals of a straight line, and which rows are held out."""
    gain, offset = benchmark.linear(recording)
    steps, taken = walk(recording.counts, STEP_COUNTS)
    seen = np.isfinite(recording.angles_deg).all(axis=1)
    rows = recording.counts[seen]
    residual = recording.angles_deg[seen] - rows @ gain.T - offset
    scale = float(residual.std())
    tables = [table.astype(np.float32) for table in (steps / 1000, rows / 1000, residual / scale)]
    # Every tenth block of 2 % is held out.
    held_out = (np.arange(len(rows)) * 50 // len(rows)) % 10 == 4
    return tables[0], tables[1], taken[seen], tables[2], held_out, (gain, offset, scale)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--physics", nargs="*", default=benchmark.PHYSICS)
    parser.add_argument("--seeds", nargs="*", type=int, default=benchmark.SEEDS)
    parser.add_argument("--protocol", default="reversals", choices=tuple(benchmark.PROTOCOLS))
    parser.add_argument("--networks", nargs="*", default=("gru", "tcn"))
    parser.add_argument("--minutes", type=float, default=2.0, help="for each network")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    for case in benchmark.cases(arguments.physics, arguments.seeds, (arguments.protocol,), folder=arguments.folder / "recordings"):
        steps, rows, before, targets, held_out, (gain, offset, scale) = prepare(case.train())
        for name in arguments.networks:
            network = {"gru": Gru, "tcn": Tcn}[name]()
            curve = train(network, steps, rows, before, targets, held_out, arguments.minutes, case.seed)
            path = arguments.folder / name / f"{case.physics}-{case.seed}.json"
            path.parent.mkdir(parents=True, exist_ok=True)
            from_torch(
                network.layers(), step_counts=STEP_COUNTS, output_scale=(scale, scale), output_centre=offset,
                skip_gain=gain, path=path,
            )  # fmt: skip
            best = min(curve, key=lambda row: row[2])
            size = sum(parameter.numel() for parameter in network.parameters())
            note = {"parameters": size, "unit_deg": scale, "curve": curve}
            path.with_suffix(".curve.json").write_text(json.dumps(note))
            print(f"{path.stem} {name}: {size} parameters, {len(curve)} epochs, {scale * best[2]:.3f} deg held out", flush=True)


if __name__ == "__main__":
    main()
