"""Draw the pictures of guide/from-cad.md by its own script and commands: `python docs/cad_pictures.py`."""

from __future__ import annotations

import os
import re
import runpy
import shutil
import tempfile
from pathlib import Path

from apo_bench.cli.app import main as run

PICTURES = Path(__file__).resolve().parent / "pictures"
PAGE = PICTURES.parent / "guide" / "from-cad.md"
COMMANDS = (
    "assembly import jig.step --out jig.toml",
    "part import jig.step --out parts",
    "inspect graph jig.toml --out graph.png",
    "inspect poses jig.toml --out jig.png",
)
DRAWN = {
    "parts/cover.png": "cad_cover.png",
    "graph.png": "graph_from_cad.png",
    "jig.png": "cad_jig.png",
}
"""What the commands write, and its name among the pictures."""


def main() -> None:
    script = re.search(r'^```python title="jig.py"\n(.*?)^```', PAGE.read_text(encoding="utf-8"), re.M | re.S)
    assert script is not None, f"{PAGE} has the script jig.py"
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        Path("jig.py").write_text(script.group(1), encoding="utf-8")
        runpy.run_path("jig.py")
        for command in COMMANDS:
            code = run(command.split())
            assert code == 0, f"apo-bench {command} ends with {code}"
        for source, name in DRAWN.items():
            shutil.copy(source, PICTURES / name)
        os.chdir(PICTURES)


if __name__ == "__main__":
    main()
