"""Trains the GRU and the TCN of the benchmark on the rows of a recording, and writes them for ``i2ris``.

    python train_networks.py FOLDER --physics preisach --seeds 1 --protocol reversals --minutes 2

writes ``FOLDER/gru/PHYSICS-SEED.json`` and ``FOLDER/tcn/...`` (for ``python -m i2ris.benchmark_table``) and
beside each its training curve. Both learn what a straight line leaves over, on exactly what the controller does: a row
is one step from the hidden state after the steps before it. Pieces of the path begin anywhere, positions jitter by some
counts and features drop out: a recording has few rows, and without these a network learns them by heart. The rows that
`i2ris calibrate fit` would hold out are validation, on the whole path; the best epoch on them is kept.
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
#: Steps of a piece whose rows are learned, and before it.
CHUNK = 160
WARM = 60
#: Deviation of the positions of steps, counts.
JITTER = 2.0
DROPOUT = 0.1
#: Epochs between two looks at the rows held out.
LOOK = 20


class Front(nn.Conv1d):
    """Position and motion since the step before, to be learned further: the motion of a step is a hundredth of the range,
    and from positions alone a network is slow to find it."""

    def __init__(self) -> None:
        super().__init__(2, 4, 2)
        with torch.no_grad():
            motion = 1000 / STEP_COUNTS / 2 * torch.eye(2)
            self.weight.copy_(torch.stack([torch.cat([0 * motion, -motion]), torch.cat([torch.eye(2), motion])], -1))
            self.bias.zero_()

    def values(self, present, past):
        """Of positions (..., 2)."""
        return present @ self.weight[..., 1].T + past @ self.weight[..., 0].T + self.bias


class Gru(nn.Module):
    WIDTH = 64
    #: Of so many rows one is learned in an epoch: here a row costs little beside the steps.
    THIN = 1

    def __init__(self) -> None:
        super().__init__()
        self.front, self.cell, self.out = Front(), nn.GRU(4, self.WIDTH), nn.Linear(self.WIDTH, 2)

    def layers(self):
        return [nn.ConstantPad1d((1, 0), 0.0), self.front, self.cell, self.out]

    def rows(self, steps, rows, before):
        """``steps``: (T, B, 2); ``rows``: (R, B, 2), each after ``before`` (R, B) steps."""
        padded = torch.cat([torch.zeros(1, steps.shape[1], 2), steps])
        hidden = self.cell(self.front.values(steps, padded[:-1]))[0]
        hidden = torch.cat([torch.zeros(1, steps.shape[1], self.WIDTH), hidden])
        picked = hidden.gather(0, before[..., None].expand(-1, -1, self.WIDTH)).reshape(1, -1, self.WIDTH)
        inputs = self.front.values(rows, padded.gather(0, before[..., None].expand(-1, -1, 2)))
        features = self.cell(inputs.reshape(1, -1, 4), picked)[0][0]
        return self.out(nn.functional.dropout(features, DROPOUT, self.training)).reshape(rows.shape)


class Tcn(nn.Module):
    """Causal convolutions of three taps, 1, 2, 4 and 8 steps apart: 31 steps of the past."""

    WIDTH, DILATIONS = 12, (1, 2, 4, 8)
    PAST = 2 * sum(DILATIONS) + 1
    THIN = 4

    def __init__(self) -> None:
        super().__init__()
        parts, inputs = [nn.ConstantPad1d((1, 0), 0.0), Front()], 4
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
        return self.out(nn.functional.dropout(values[..., 0], DROPOUT, self.training)).reshape(rows.shape)


def pieces(steps, rows, before, targets, learned, generator, thin):
    """Pieces of the path that begin anywhere, each half over the next: steps, rows in it, steps before each, what is wanted,
    and which of these rows count."""
    begins = np.arange(-generator.integers(CHUNK // 2), len(steps) - WARM, CHUNK // 2)
    first, last = (np.searchsorted(before, begins + WARM + behind) for behind in (0, CHUNK))
    longest = int((last - first).max())
    number = np.arange(generator.integers(thin), longest, thin)
    pick = np.minimum(first[:, None] + number, np.maximum(last - 1, 0)[:, None])
    real = number[None] < (last - first)[:, None]
    reach = np.clip(begins[:, None] + np.arange(WARM + CHUNK), 0, len(steps) - 1)
    jitter = (JITTER / 1000 * generator.standard_normal((*reach.shape, 2))).astype(np.float32)
    local = np.clip(before[pick] - begins[:, None], 0, WARM + CHUNK)
    tables = (steps[reach] + jitter, rows[pick], local, targets[pick], real & learned[pick])
    return [torch.tensor(table).transpose(0, 1) for table in tables]


def train(network, steps, rows, before, targets, held_out, minutes: float, seed: int):
    """The network of the best epoch on the rows held out, and the curve: epoch, error on what was learned, and held out."""
    torch.manual_seed(seed)
    generator = np.random.default_rng(seed)
    whole = [torch.tensor(table)[:, None] for table in (steps, rows, before)]
    wanted = torch.tensor(targets)
    best, curve, kept = float("inf"), [], None
    optimiser = torch.optim.AdamW(network.parameters(), lr=4e-3, weight_decay=0.02)
    begun, epoch, share = time.process_time(), 0, 0.0
    while share < 1:
        share = min((time.process_time() - begun) / (60 * minutes), 1)
        for group in optimiser.param_groups:
            group["lr"] = 4e-3 * 0.5 * (1 + np.cos(np.pi * share)) + 2e-5
        network.train()
        path, inputs, local, goals, counted = pieces(steps, rows, before, targets, ~held_out, generator, network.THIN)
        loss = ((network.rows(path, inputs, local) - goals) ** 2).sum(-1)[counted].mean()
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        epoch += 1
        if epoch % LOOK and share < 1:
            continue
        network.eval()
        with torch.no_grad():
            error = ((network.rows(*whole)[:, 0] - wanted) ** 2).sum(-1)
        learned, held = (float(error[torch.tensor(part)].mean().sqrt()) for part in (~held_out, held_out))
        curve.append([epoch, learned, held])
        if held < best:
            best, kept = held, {name: value.clone() for name, value in network.state_dict().items()}
    network.load_state_dict(kept)
    network.eval()
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


def predict(network, counts, gain, offset, scale):
    """Angles along a path of the motors, deg, as the controller finds them."""
    steps, taken = walk(counts, STEP_COUNTS)
    tables = [torch.tensor(table)[:, None] for table in ((steps / 1000).astype(np.float32), (counts / 1000).astype(np.float32), taken)]
    with torch.no_grad():
        parts = [network.rows(tables[0], *(table[begin : begin + 5000] for table in tables[1:])) for begin in range(0, len(counts), 5000)]
    return scale * torch.cat(parts)[:, 0].numpy() + counts @ gain.T + offset


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--physics", nargs="*", default=benchmark.PHYSICS)
    parser.add_argument("--seeds", nargs="*", type=int, default=benchmark.SEEDS)
    parser.add_argument("--protocol", default="reversals", choices=tuple(benchmark.PROTOCOLS))
    parser.add_argument("--networks", nargs="*", default=("gru", "tcn"))
    parser.add_argument("--minutes", type=float, default=2.0, help="of the processor, for each network")
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
            forward = benchmark.forward(case, lambda counts, network=network: predict(network, counts, gain, offset, scale))
            note = {"parameters": size, "minutes": arguments.minutes, "unit_deg": scale, "forward": forward, "curve": curve}
            path.with_suffix(".curve.json").write_text(json.dumps(note))
            print(f"{path.stem} {name}: {size} parameters, {curve[-1][0]} epochs, {scale * best[2]:.3f} deg held out, forward {forward:.3f}", flush=True)


if __name__ == "__main__":
    main()
