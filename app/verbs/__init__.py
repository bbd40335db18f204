"""One file a verb: ``app/verbs/<verb>.py``.

To add a verb, write a module that

- opens with a docstring whose **first line** is what ``pkmcal --help`` says about it, a short
  phrase in the operator's words without a final stop;
- exports ``command``, a :class:`click.Command` (its own ``help`` is the docstring of the decorated
  function);
- stays a face: arguments in, one call into the layers below, the answer printed. About 150 lines.

It is found by its file name (``import_.py`` is ``import``) and imported when it is called or asked
for its help. At its top it imports what its help needs and no more; what answers (jobs, ``calib``,
numpy, screens) is imported in the function that calls it, and types for the checker alone under
``TYPE_CHECKING``. Numbers that help texts state lie in :mod:`app.defaults` and
:mod:`calib.defaults`. Its place in ``pkmcal --help`` comes from ``TASKS`` in :mod:`app.cli`; a verb
that is missing there is listed last.

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
        from app.jobs.fitting import fit

        found = fit(runs)
        answer.show(found.to_json(), as_json, words(found))
"""
