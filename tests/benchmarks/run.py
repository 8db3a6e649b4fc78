"""Run the shell benchmarks and timings one after the other, print a table and keep the figures: `make bench`."""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
from pathlib import Path

CASES = (
    ("assembly",),
    ("cantilever-shear", "--order", "2", "--mesh", "8x1"),
    ("cantilever-moment", "--order", "2", "--mesh", "8x1"),
    ("slit-annulus", "--order", "2", "--mesh", "4x24"),
    ("hemisphere", "--order", "2", "--mesh", "16x16"),
    ("pinched-cylinder", "--order", "2", "--mesh", "16x16"),
    ("scordelis-lo", "--order", "2", "--mesh", "8x8"),
    ("heavy-elastica", "--order", "2", "--mesh", "8x2"),
)
COLUMNS = ("error_percent", "newton_iterations", "assembly_ms_per_iteration", "solve_ms_per_iteration", "wall_s")


def run(case: tuple[str, ...]) -> dict:
    """The JSON object of one `mfar benchmark` run, with its command and exit code."""
    command = [sys.executable, "-m", "mfar_fem.cli.main", "benchmark", *case, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        result = json.loads(done.stdout)
    except json.JSONDecodeError:
        result = {"error": {"message": done.stderr.strip()[-500:] or "no JSON on standard output"}}
    return {"command": "mfar benchmark " + " ".join(case), "exit_code": done.returncode, **result}


def show(value) -> str:
    """A figure for the table; the largest of several."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        numbers = [abs(v) for v in value if isinstance(v, int | float)]
        value = max(numbers) if numbers else None
    return "" if value is None else f"{value:.4g}"


def main() -> int:
    """Run all cases; 1 if any failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks.json"))
    parser.add_argument("--only", help="run the cases whose name contains this")
    options = parser.parse_args()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    results = []
    print("  ".join(["case".ljust(46), *(name.rjust(len(name)) for name in COLUMNS)]))
    for case in CASES:
        if options.only and options.only not in case[0]:
            continue
        result = run(case)
        results.append(result)
        cells = [show(result.get(name)).rjust(len(name)) for name in COLUMNS]
        print("  ".join([" ".join(case).ljust(46), *cells]), flush=True)
        if "error" in result:
            print("    " + str(result["error"].get("message")), flush=True)
        for key in ("order1_us_per_element", "order2_us_per_element", "membrane_ratio_to_bilinearform"):
            if key in result:
                print(f"    {key}: {show(result[key])}")
    machine = {"platform": platform.platform(), "processor": platform.processor(), "python": platform.python_version()}
    options.out.write_text(json.dumps({"machine": machine, "results": results}, indent=2), encoding="utf-8")
    print(f"written: {options.out}")
    return int(any(result["exit_code"] for result in results))


if __name__ == "__main__":
    sys.exit(main())
