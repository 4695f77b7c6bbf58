#!/usr/bin/env python3
"""What examples/verify.py says of many files, in one process.

Reads lines of {"decision": "…", "roster": "…", "words": […]} from standard input; prints of each whether it is proven, and what was said.
"""
import contextlib
import importlib.util
import io
import json
import pathlib
import sys
import tempfile
import traceback

HERE = pathlib.Path(__file__).resolve()
spec = importlib.util.spec_from_file_location("verify", HERE.parents[2] / "examples" / "verify.py")
verify = importlib.util.module_from_spec(spec)
spec.loader.exec_module(verify)


def verdict(words: list) -> list:
    sys.argv = ["verify.py", *words]
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            verify.main()
    except SystemExit as ended:
        return [not ended.code, str(ended.code)]
    except BaseException:
        return [False, traceback.format_exc()]
    return [True, said.getvalue()]


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        files = [pathlib.Path(folder) / name for name in ("decision.json", "roster.json")]
        for line in sys.stdin:
            shown = json.loads(line)
            for file, text in zip(files, (shown["decision"], shown["roster"])):
                file.write_bytes(bytes(text))
            print(json.dumps(verdict([str(files[0]), "--roster", str(files[1]), *shown["words"]])))


if __name__ == "__main__":
    main()
