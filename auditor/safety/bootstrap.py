"""The file that a child process runs first, before anything but Python's own modules can be imported.

The package is loaded from the folder that the parent loaded it from, whether or not that folder is on the path: a
checkout that is run from its own root has to work without the working folder on the path.
"""

import gc
import json
import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location


def main() -> int:
    """Run what `launching.start` asks for in `sys.argv[1]`."""
    package, path, module = json.loads(sys.argv.pop(1))
    sys.path[:] = path
    _load_package(package)
    import_module("auditor.safety.network").give_up_network()
    code: int = import_module(module).main()
    gc.freeze()  # as the command line does at its end
    return code


def _load_package(folder: str) -> None:
    spec = spec_from_file_location("auditor", f"{folder}/__init__.py", submodule_search_locations=[folder])
    assert spec is not None
    assert spec.loader is not None
    sys.modules["auditor"] = package = module_from_spec(spec)
    spec.loader.exec_module(package)


if __name__ == "__main__":
    raise SystemExit(main())
