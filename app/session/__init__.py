"""Sessions: a plan run on a station, with a journal. See :mod:`app.session.session`."""
