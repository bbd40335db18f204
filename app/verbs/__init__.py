"""One file a verb: ``app/verbs/<verb>.py``.

To add a verb, write a module that

- opens with a docstring whose **first line** is what ``pkmcal --help`` says about it, a short
  phrase in the operator's words without a final stop;
- exports ``command``, a :class:`click.Command` (its own ``help`` is the docstring of the decorated
  function);
- stays a face: arguments in, one call into the layers below, the answer printed. About 150 lines.

It is found by its file name (``import_.py`` is ``import``) and imported only when it is called, so
heavy imports (numpy, drivers) at its top are fine. Its place in ``pkmcal --help`` comes from
``TASKS`` in :mod:`app.cli`; a verb that is missing there is listed last.

Errors are raised, never printed: :class:`calib.errors.BadInput` ends the program with exit code 2,
:class:`drivers.errors.DeviceError` with 3, :class:`app.errors.StoppedByOperator` with 4,
:class:`app.errors.GateRefused` with 5. Answers go through :mod:`app.answer`: with ``--json`` one
JSON object is on standard output and nothing else; talk, progress and warnings are on standard
error. Options that several verbs share (``--json``) are decorators in :mod:`app.answer`.

    \"\"\"Fit the model to runs\"\"\"

    import click
    from app import answer

    @click.command()
    @click.argument("runs", nargs=-1, required=True)
    @answer.json_option
    def command(runs: tuple[str, ...], as_json: bool) -> None:
        \"\"\"Fit the baseline model, plus the effects asked for, to one or several runs.\"\"\"
        ...
        answer.show(result, as_json, text)
"""
