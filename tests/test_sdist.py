"""What a source distribution contains. Oracle: the files under version control."""

import shutil
import subprocess
import sys
import tarfile

import pytest
from conftest import CHECKOUT

BUILD = "from setuptools.build_meta import build_sdist; build_sdist('dist')"


@pytest.mark.skipif(not (CHECKOUT / ".git").exists(), reason="files under version control are not known")
def test_the_source_distribution_contains_all_files_of_the_repository(tmp_path):
    listed = subprocess.run(["git", "ls-files"], cwd=CHECKOUT, check=True, capture_output=True, text=True).stdout
    files = [name for name in listed.splitlines() if (CHECKOUT / name).exists()]
    for name in files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(CHECKOUT / name, tmp_path / name, follow_symlinks=False)
    subprocess.run([sys.executable, "-c", BUILD], cwd=tmp_path, check=True, capture_output=True)
    (built,) = (tmp_path / "dist").iterdir()
    with tarfile.open(built) as archive:
        contained = {name.partition("/")[2] for name in archive.getnames()}
    assert {"cases/focusing.toml", "docs/method.md", "environment.yml"} <= contained
    assert set(files) - contained <= {".gitignore"}
    assert "examples/paper/__init__.py" in contained
