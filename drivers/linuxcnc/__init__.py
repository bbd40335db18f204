"""LinuxCNC with genhexkins: a hexapod's controller that holds its geometry in HAL pins.

``helper.py`` runs under the Python that has LinuxCNC's modules; ``link`` talks to it, ``places``
says which parameter is which pin, ``configuration`` reads and rewrites the INI and HAL files,
``controller`` is the :class:`drivers.interface.MotionController`. docs/linuxcnc.md.
"""
