"""Any instrument or program that sends one reading a line: on TCP, on a serial port, into a file.

``source`` is where lines come from, ``reading`` what stands in one, ``tracker`` an instrument of
them (:class:`drivers.interface.Tracker`), ``kind`` its settings in a site file. See docs/lines.md.
"""
