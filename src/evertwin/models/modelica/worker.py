"""The compiler's own process: reads one Modelica model, writes its equations as JSON.

Run as a file, never imported: it needs nothing of the package, so it starts in a few hundredths of
a second, and whatever the compiler does (loop, crash, take all memory) ends with this process.
One JSON object comes in on stdin, one goes out on stdout.
"""

from __future__ import annotations

import json
import resource
import sys
from typing import Any


def compiled(order: dict[str, Any]) -> dict[str, Any]:
    """Equations of the model, or what the compiler says against it."""
    try:
        import rumoca
    except ModuleNotFoundError as error:
        return {"missing": str(error.name)}
    try:
        session = rumoca.Session(roots=order["roots"] or None)
        model = session.load(order["file"], model=order["model"])
        return {"name": model.name, "dae": json.loads(model.to_json("dae"))}
    except rumoca.RumocaError as error:
        said = [d.message for d in rumoca.validate(order["file"]) if d.level == "error"]
        return {"refused": str(error), "diagnostics": said}


if __name__ == "__main__":
    order = json.load(sys.stdin)
    limit = int(order["memory"])
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    json.dump(compiled(order), sys.stdout)
