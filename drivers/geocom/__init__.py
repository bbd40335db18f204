"""Leica total stations that speak GeoCOM: an ASCII request and an ASCII answer a line.

``codes`` are procedures and return codes, ``link`` one request after the other on a serial line or
TCP, ``total_station`` a :class:`drivers.interface.Tracker`, ``kind`` its settings. See
docs/protocols/geocom.md.
"""
