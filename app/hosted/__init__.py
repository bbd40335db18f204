"""Machines whose motion the host computes: drives alone, and controllers that take only poses.

``controller`` makes a full :class:`drivers.interface.MotionController` of such a device; ``motors``
and ``poses`` say how a command reaches it and what comes back; ``parameters`` is the set in use,
``store`` keeps sets on the disk. Docs: docs/host-store.md.
"""
