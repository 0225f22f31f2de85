"""Write `apread.json`: what apread reads of these files. Needs `pip install --no-deps apread tqdm`."""

import gzip
import hashlib
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).parent


def read(packed: Path) -> dict[str, Any]:
    """Unit, first value, and SHA-256 of all values as float64, of each channel."""
    from apread import APReader

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / packed.stem
        path.write_bytes(gzip.decompress(packed.read_bytes()))
        channels = APReader(str(path)).Channels
    values = {channel.Name: np.asarray(channel.data, "<f8") for channel in channels}
    return {
        channel.Name: [
            channel.unit,
            float(values[channel.Name][0]),
            hashlib.sha256(values[channel.Name]).hexdigest(),
        ]
        for channel in channels
    }


if __name__ == "__main__":
    found = {packed.name: read(packed) for packed in sorted(FOLDER.glob("*.gz"))}
    (FOLDER / "apread.json").write_text(
        json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
