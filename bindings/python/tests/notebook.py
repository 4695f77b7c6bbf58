"""Runs a notebook's code without Jupyter, and shows what its cells show.

    python3 notebook.py FILE.ipynb             fails where a cell does, or where none of its outputs was kept
    python3 notebook.py FILE.ipynb --keep      keeps the outputs in the file
"""

import ast
import contextlib
import io
import json
import sys
from pathlib import Path


def shown(value):
    """What a notebook shows of a cell's last value."""
    picture = getattr(value, "_repr_svg_", None)
    data = {"text/plain": [repr(value)], **({"image/svg+xml": lines(picture())} if picture else {})}
    return {"output_type": "execute_result", "metadata": {}, "data": data}


def lines(text):
    return text.splitlines(keepends=True)


def run(cell, names):
    """The outputs of one cell of code."""
    body = ast.parse("".join(cell["source"]))
    last = body.body.pop() if body.body and isinstance(body.body[-1], ast.Expr) else None
    printed, outputs = io.StringIO(), []
    with contextlib.redirect_stdout(printed):
        exec(compile(body, "cell", "exec"), names)
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), names) if last else None
    if printed.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": lines(printed.getvalue())})
    return outputs + ([shown(value)] if value is not None else [])


def kinds(outputs):
    """What kinds of outputs these are: their contents follow from how much was run."""
    return [(output["output_type"], *sorted(output.get("data", ()))) for output in outputs]


def main():
    path = Path(sys.argv[1])
    notebook = json.loads(path.read_text())
    sys.path.insert(0, str(path.resolve().parent))
    names = {"__name__": "__main__"}
    for number, cell in enumerate((cell for cell in notebook["cells"] if cell["cell_type"] == "code"), 1):
        outputs = run(cell, names)
        for output in outputs:
            if output["output_type"] == "execute_result":
                output["execution_count"] = number
            print("".join(output.get("text", output.get("data", {}).get("text/plain", ""))), end="")
        if "--keep" in sys.argv:
            cell.update(outputs=outputs, execution_count=number)
        assert kinds(outputs) == kinds(cell["outputs"]), f"cell {number} shows {kinds(outputs)}, kept is {kinds(cell['outputs'])}: --keep"
    if "--keep" in sys.argv:
        path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
