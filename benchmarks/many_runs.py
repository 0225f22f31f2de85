"""A hundred thousand run files, listed and filtered: `python benchmarks/many_runs.py [--runs 10000,100000]`.

Run files of 5 s at 200 Hz, hard links to a few of them, in folders of a thousand. The first listing examines
each file; it is measured on one folder and scaled, since it grows with their number alone. The index of all
is then made of those summaries, and the rest is measured on all files. Processor times.
"""

import argparse
import os
import resource
import statistics
import sys
import tempfile
from pathlib import Path

import msgspec
from library import parameters

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from app.runs import listing
from app.runs.listing import RunFilter, list_runs
from app.runs.simulated import write_simulated_run

REPEATS = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", default="10000,100000")
    chosen = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    print("| runs | first listing, scaled | listed | filtered | one changed | index | memory, MB |")
    print("|---|---|---|---|---|---|---|")
    for count in map(int, chosen.runs.split(",")):
        with tempfile.TemporaryDirectory() as place:
            os.environ["XDG_CACHE_HOME"] = f"{place}/cache"
            print(row(Path(place) / "library", count), flush=True)


def row(library: Path, count: int) -> str:
    """Measure a library of so many runs; processor times, as cells of a table."""
    files = fill(library, count)
    part = library / "00"
    first_s, found = timed(lambda: list_runs(part))
    first_s *= count / len(found)
    model = found[0]
    stamp = (files[0].stat().st_size, files[0].stat().st_mtime_ns)
    index = {str(path): (stamp, msgspec.structs.replace(model, path=str(path))) for path in files}
    listing._save_index(library, index)
    del index
    listed_s = statistics.median(timed(lambda: list_runs(library))[0] for _ in range(REPEATS))
    filtered = RunFilter(series="1FFM0", text="simulated")
    filtered_s = statistics.median(timed(lambda: list_runs(library, filtered))[0] for _ in range(REPEATS))
    files[-1].unlink()
    write_simulated_run(files[-1], parameters().simulate(5.0), parameters(), series="1FFM0", rate_hz=200.0)
    changed_s, _ = timed(lambda: list_runs(library))
    size = listing.index_path(library).stat().st_size
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    cells = f"{first_s:.0f} | {listed_s:.2f} | {filtered_s:.2f} | {changed_s:.2f} | {size / 1e6:.1f} MB"
    return f"| {count} | {cells} | {memory_mb:.0f} |"


def fill(library: Path, count: int) -> list[Path]:
    """Paths of hard links to one short run: a file system takes some ten thousand links of a file."""
    files: list[Path] = []
    for number in range(count):
        folder = library / f"{number // 1000:02d}"
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"run_{number:06d}.h5"
        if number % 20_000 == 0:
            write_simulated_run(path, parameters().simulate(5.0), parameters(), series="1FFM0", rate_hz=200.0)
            os.utime(path, ns=(10**18, 10**18))
        else:
            os.link(files[number // 20_000 * 20_000], path)
        files.append(path)
    return files


def timed(work):
    """Processor time of this process and of those that it waited for, and what the work returns."""
    before = used_s()
    result = work()
    return used_s() - before, result


def used_s() -> float:
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


if __name__ == "__main__":
    main()
