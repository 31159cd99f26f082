"""A twin's store on a PostgreSQL server that several nodes share.

>>> SharedStore.__name__
'SharedStore'
"""

from __future__ import annotations

from evertwin.errors import NoStore, StoreError, StoreLocked
from evertwin.store.owners.owners import SqlOwners, fence
from evertwin.store.postgres.database import Postgres
from evertwin.store.sql.store import SqlStore


class SharedStore(SqlStore):
    """A store on a server (`Store` says what each method does).

    >>> SharedStore.__mro__[1].__name__
    'SqlStore'
    """

    def __init__(
        self, server: str, twin: str, token: int | None = None, *, read_only: bool = False
    ) -> None:
        """Open or create.

        Args:
            server: as in ``postgresql://user@host/database``.
            twin: its name.
            token: of the node that has claimed it; None: for a process outside of the fleet, where
                no node has it.
            read_only: look while another process may be writing.

        Raises:
            StoreLocked: another process, or a node, has it.
            StoreDamaged: it does not match its hashes.
            StoreError: the server cannot be reached, or is another's.
        """
        database = Postgres(server, twin, token or 0)
        try:
            if token is None and not read_only:
                token = self._alone(database, twin)
            if read_only:
                if not database.query("SELECT length FROM head"):
                    raise NoStore(f"{database.path}: no such store")
                limit = None
            else:
                database.begin()
                limit = fence(twin, token or 0, database.shared, database.locked)
        except StoreError:
            database.close()
            raise
        super().__init__(database, threaded=not read_only, read_only=read_only, fence=limit)

    @staticmethod
    def _alone(database: Postgres, twin: str) -> int:
        """Keeps other processes out while this connection lasts; the token that is the newest."""
        query = "SELECT pg_try_advisory_lock(hashtext('evertwin'), hashtext(?))"
        ((free,),) = database.query(query, (twin,))
        if not free:
            raise StoreLocked(f"{database.path}: open in another process: wait until it ends")
        for one in SqlOwners(database).held():
            if one.twin == twin:
                if one.left > 0.0:
                    raise StoreLocked(
                        f"{database.path}: node {one.node!r} works with it: stop it, or ask it"
                    )
                return one.token
        return 0
