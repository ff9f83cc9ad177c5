"""Size, structure and naming of the code, as figures and as the target table of docs/architecture.md.

    ./env python -m benchmarks.size            # print the table
    ./env python -m benchmarks.size --write    # write it into docs/architecture.md

Code lines exclude docstrings, comments and blank lines. Product code excludes tests, docs, benchmarks and examples.
"""

import ast
import io
import re
import sys
import tokenize
from collections import Counter, defaultdict
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
PAGE = CHECKOUT / "docs" / "architecture.md"
PRODUCT = ("wavetank", "meshes", "postprocess")
ATTRIBUTES = 15
VAGUE = frozenset(
    """
    answer answering answers apart asked began begun beside carried carries carry doubt doubts farther foreseen found
    glance hasty held hurries judge kept known knows lasting led left look looked looks maker moved near others
    passing patient quickened room said seen share shares sight spelt stand stands steered stood taken told together
    took turned unhurried verdict way ways whole wrong
    """.split()  # noqa: SIM905
)
ROWS = {  # figure: value at e05a973, target
    "product code [lines]": (33153, 18000),
    "C [lines]": (2401, 1600),
    "C files": (27, 8),
    "tests [lines]": (18395, 13000),
    "functions": (3819, 1900),
    "protocols": (76, 14),
    "classes with more than 15 attributes": (11, 0),
    "class names defined twice": (37, 0),
    "vague words in definitions": (1708, 120),
    "most imports in one module": (44, 20),
}
BEGIN, END = "| figure | e05a973 | now | target |", "<!-- end of the target table -->"


def python_lines(text: str, tree: ast.Module) -> int:
    """Return the number of code lines of a Python module."""
    docstrings = {
        line
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    layout = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    lines = {
        line
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type not in layout
        for line in range(token.start[0], token.end[0] + 1)
    }
    return len(lines - docstrings)


def c_lines(text: str) -> int:
    """Return the number of code lines of a C file."""
    text = re.sub(r"/\*.*?\*/", lambda comment: "\n" * comment[0].count("\n"), text, flags=re.DOTALL)
    return sum(1 for line in re.sub(r"//.*", "", text).splitlines() if line.strip())


def defined_names(tree: ast.Module) -> list[str]:
    """Return the names of functions, arguments and assigned variables and attributes."""
    names = []
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                names.append(name)
            case ast.arg(arg=name) | ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                names.append(name)
    return names


def attributes(cls: ast.ClassDef) -> int:
    """Return the number of attributes that the methods of a class assign."""
    return len(
        {
            node.attr
            for node in ast.walk(cls)
            if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
            if isinstance(node.value, ast.Name) and node.value.id == "self"
        }
    )


def figures(root: Path = CHECKOUT) -> dict[str, int]:
    """Return the figures of ``ROWS`` of a checkout."""
    count: Counter[str] = Counter(dict.fromkeys(ROWS, 0))
    modules_of_class = defaultdict(set)
    for path in (file for folder in PRODUCT for file in (root / folder).rglob("*.[ch]")):
        lines = c_lines(path.read_text(encoding="utf-8"))
        count.update({"C [lines]": lines, "product code [lines]": lines, "C files": 1})
    for path in (file for folder in PRODUCT for file in (root / folder).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        nodes = list(ast.walk(tree))
        classes = [node for node in nodes if isinstance(node, ast.ClassDef)]
        imports = sum(isinstance(node, ast.ImportFrom) and (node.module or "").startswith("wavetank") for node in nodes)
        for cls in classes:
            modules_of_class[cls.name].add(path)
        words = (word.lower() for name in defined_names(tree) for word in re.split(r"_+|(?<=[a-z])(?=[A-Z])", name))
        count.update(
            {
                "product code [lines]": python_lines(text, tree),
                "functions": sum(isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) for node in nodes),
                "protocols": sum(any("Protocol" in ast.unparse(base) for base in cls.bases) for cls in classes),
                "classes with more than 15 attributes": sum(attributes(cls) > ATTRIBUTES for cls in classes),
                "vague words in definitions": sum(word in VAGUE for word in words),
            }
        )
        count["most imports in one module"] = max(count["most imports in one module"], imports)
    count["class names defined twice"] = sum(len(modules) > 1 for modules in modules_of_class.values())
    for path in (root / "tests").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        count["tests [lines]"] += python_lines(text, ast.parse(text))
    return dict(count)


def table(now: dict[str, int]) -> str:
    """Return the target table in Markdown."""
    rows = [f"| {name} | {before} | {now[name]} | {target} |" for name, (before, target) in ROWS.items()]
    return "\n".join([BEGIN, "|---|---|---|---|", *rows, END])


def recorded(page: str) -> dict[str, int]:
    """Return the figures of the column "now" of the target table in a page."""
    block = page[page.index(BEGIN) : page.index(END)]
    return {name: int(value) for name, value in re.findall(r"^\| (.+?) \| \d+ \| (\d+) \|", block, flags=re.MULTILINE)}


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    new = table(figures())
    print(new.removesuffix(END))
    if "--write" in sys.argv[1:]:
        start, stop = text.index(BEGIN), text.index(END) + len(END)
        PAGE.write_text(text[:start] + new + text[stop:], encoding="utf-8")
