"""List the benches, or run one: ``python -m bench [NAME [ARGUMENTS]]``."""

import ast
import os
import runpy
import sys
from pathlib import Path

FOLDER = Path(__file__).parent


def benches() -> dict[str, str]:
    """Name of every bench and the first line of what it says about itself."""
    return {
        path.stem: (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "")
        .partition("\n")[0]
        for path in sorted(FOLDER.glob("*.py"))
        if not path.stem.startswith("_")
    }  # fmt: skip


def caveat() -> str:
    """How busy this computer is: times are best-of, and only ratios within one run compare."""
    cores = os.cpu_count() or 1
    if not hasattr(os, "getloadavg"):
        return f"{cores} cores; best-of times, compare ratios only"
    return f"{cores} cores, load {os.getloadavg()[0]:.1f}; best-of times, compare ratios only"


def main() -> int:
    """Run the bench that was named, or list all."""
    there = benches()
    if len(sys.argv) < 2:
        width = max(map(len, there))
        print("python -m bench NAME\n")
        for name, says in there.items():
            print(f"  {name:{width}}  {says}")
        return 0
    name = sys.argv[1]
    if name not in there:
        print(f'there is no bench "{name}": {", ".join(there)}', file=sys.stderr)
        return 2
    print(caveat())
    sys.argv = sys.argv[1:]
    runpy.run_module(f"bench.{name}", run_name="__main__", alter_sys=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
