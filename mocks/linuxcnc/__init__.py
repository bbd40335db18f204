"""A station whose controller is LinuxCNC itself, without a screen and without real time.

``configuration`` writes its files, ``program`` starts and ends it, ``bridge`` (a script under the
Python that has LinuxCNC's modules) tells where its motors stand, ``server`` lets the mock's true
machine follow them. Nothing of LinuxCNC is part of this program: it must be installed.
"""
