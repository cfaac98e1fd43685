"""All files name one version, and the installed package has it."""

import importlib.metadata

from support.versions import versions

import wive


def test_all_files_name_one_version():
    assert set(versions().values()) == {wive.__version__}


def test_the_installed_package_has_the_version_of_its_module():
    assert importlib.metadata.version("wive") == wive.__version__
