"""Size, structure and naming of the code do not grow. Oracle: the target table of docs/architecture.md."""

from benchmarks.size import PAGE, ROWS, figures, recorded


def test_no_figure_exceeds_the_target_table():
    now, table = figures(), recorded(PAGE.read_text(encoding="utf-8"))
    assert set(table) == set(ROWS)
    grown = {name: (value, table[name]) for name, value in now.items() if value > table[name]}
    how = "a feature records its growth by python -m benchmarks.size --write, and its commit gives the reason"
    assert not grown, f"{grown}: (now, docs/architecture.md); reduce the code; {how}."


def test_figures_count_code_and_names(tmp_path):
    (tmp_path / "wavetank").mkdir()
    (tmp_path / "tests").mkdir()
    (tmp_path / "wavetank" / "one.py").write_text(
        '"""Docstring."""\n\nfrom typing import Protocol\n\n\nclass Kept(Protocol):  # a\n    def held(self): ...\n'
    )
    (tmp_path / "wavetank" / "two.py").write_text("from wavetank import one\n\n\nclass Kept:\n    found = 1\n")
    (tmp_path / "wavetank" / "three.c").write_text("/* text\n*/\nint x; // text\n\n")
    assert figures(tmp_path) == {
        "product code [lines]": 7,
        "C [lines]": 1,
        "C files": 1,
        "tests [lines]": 0,
        "functions": 1,
        "protocols": 1,
        "classes with more than 15 attributes": 0,
        "class names defined twice": 1,
        "vague words in definitions": 4,
        "most imports in one module": 1,
    }
