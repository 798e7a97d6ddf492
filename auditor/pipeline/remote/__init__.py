"""Recordings on object stores: found by their addresses, and copied to this computer while they are read.

The processes that read recordings have no network and no credentials: what they read may be hostile. So the process
that starts them copies the objects, each once and from its beginning to its end, into a spool on disk (`spool`), ahead
of the processes that read it (`supply`). `object_store` is the only module that knows the library for it.
"""
