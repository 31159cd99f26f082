"""Can a twin begin, and go on from what a shared store has of it? With nothing written."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

from evertwin.engine import EngineSpec
from evertwin.errors import EvertwinError, NoStore, StoreUnwritable
from evertwin.ledger.ledger import Ledger
from evertwin.ledger.versions import Versions
from evertwin.loop.loading import other_settings, unloadable
from evertwin.rows.channels import check_units
from evertwin.service.site.site_plan import Plan
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.sources.live.contract import Around
from evertwin.sources.live.registry import open_live
from evertwin.store import SharedStore
from evertwin.store.spec import StoreSpec
from evertwin.twin import Twin


def why_not(plan: Plan, server: str = "") -> tuple[str, str]:
    """Why this node cannot go on with a twin, and why it would begin a new run; empty: it need not.

    Args:
        plan: the twin as this node's files have it.
        server: the shared store; empty: a new twin is built, with its sources, and let go.

    Raises:
        StoreUnwritable: the store cannot be reached.
    """
    if plan.spec is None:
        return plan.wrong, ""
    try:
        if not server:
            _build(plan)
            return "", ""
        setup = Setup(plan.spec, model_of(plan.spec, None))
        check_units(plan.spec, setup.model)
        with closing(SharedStore(server, plan.name, read_only=True)) as store:
            ledger = Ledger(store, Versions(setup.model), plan.name, reading=True)
            return unloadable(setup, ledger), other_settings(setup, ledger)
    except NoStore:  # it begins here
        return "", ""
    except StoreUnwritable:
        raise
    except EvertwinError as error:
        return str(error), ""
    except Exception as error:  # noqa: BLE001  (a model or plug-in of the user's may raise any)
        return f"{type(error).__name__}: {error}", ""


def _build(plan: Plan) -> None:
    """Builds a twin without a store, and its sources; nothing is connected or kept."""
    assert plan.spec is not None
    spec, around = plan.spec, Around(folder=Path(plan.spec.folder))
    known = {one.name: one for one in spec.source + spec.array}
    with Twin(replace(spec, store=StoreSpec(), engine=EngineSpec())):
        for one in plan.sources:
            open_live(one, known[one.source], around)
