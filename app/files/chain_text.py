"""The words of a machine file's chains: where joints stand, and what is put behind them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from calib.errors import BadInput

_TOKEN = re.compile(r"\S+")
_JOINT = re.compile(r"(?:\w+=)?(?:[RT][xyz]|U[xyz]{2}|S[xyz]{3}|C[xyz])(?![A-Za-z])")
AXES = tuple((kind, axis) for kind in "tr" for axis in "xyz")


@dataclass(frozen=True)
class Error:
    """An error that may be put behind a joint of a chain.

    ``owner`` is the table of the chain (``limbs.arm``, ``limb_types.leg``), ``chain`` its number
    there, ``behind`` the end of the joint in the chain's text, ``joint`` its number; ``last`` where
    no joint comes after it. ``element`` is tx .. rz.
    """

    owner: tuple[str, str]
    chain: int
    behind: int
    joint: int
    last: bool
    element: str
    name: str

    @property
    def unit(self) -> str:
        """mm or rad."""
        return "mm" if self.element[0] == "t" else "rad"


def chains_of(top: Mapping[str, Any]) -> dict[tuple[str, str], list[str]]:
    """Texts of all chains of a machine file by the table in which they stand."""
    found: dict[tuple[str, str], list[str]] = {}
    for kind in ("limb_types", "limbs"):
        for name, table in top.get(kind, {}).items():
            if "chain" in table or "chains" in table:
                found[kind, name] = list(table.get("chains") or [table["chain"]])
    return found


def errors_of(top: Mapping[str, Any]) -> list[Error]:
    """Six errors at the base and behind every joint of every chain."""
    listed: list[Error] = []
    for owner, chains in chains_of(top).items():
        taken = set(re.findall(r"[A-Za-z_]\w*", " ".join(chains)))
        taken |= set(top[owner[0]][owner[1]].get("parameters", {}))
        for number, text in enumerate(chains):
            ends = [0, *(t.end() for t in _TOKEN.finditer(text) if _JOINT.match(t.group()))]
            for joint, behind in enumerate(ends):
                last = joint == len(ends) - 1
                for kind, axis in AXES:
                    name = f"{'d' if kind == 't' else 'e'}{axis}{joint}"
                    name += f"_{number + 1}" if len(chains) > 1 else ""
                    while name in taken:
                        name += "_"
                    listed.append(Error(owner, number, behind, joint, last, kind + axis, name))
    return listed


def with_errors(text: str, errors: Sequence[Error], tolerance: Mapping[str, str], says: str) -> str:
    """A machine file's text with errors put into its chains, and described among its parameters.

    Comments and everything else stay as they are. ``tolerance`` by unit, as it is written.

    Raises
    ------
    BadInput
        Where a chain is not written so that it can be found again.
    """
    import tomllib

    for owner, chains in chains_of(tomllib.loads(text)).items():
        own = [one for one in errors if one.owner == owner]
        for number, chain in enumerate(chains):
            here = [one for one in own if one.chain == number]
            if not here:
                continue
            place = text.find(f"[{owner[0]}.{owner[1]}]")
            at = text.find(chain, max(place, 0))
            if at < 0:
                raise BadInput(
                    f"the chain of {owner[1]} is not written as it reads",
                    remedy="Write it without escapes, as one text",
                )
            text = text[:at] + filled(chain, here) + text[at + len(chain) :]
        if own:
            text = _described(text, owner, own, tolerance, says)
    return text


def filled(chain: str, errors: Sequence[Error]) -> str:
    """A chain with errors put into it."""
    for behind in sorted({one.behind for one in errors}, reverse=True):
        words = " ".join(f"{one.element}:{one.name}" for one in errors if one.behind == behind)
        gap = f" {words}" if behind else f"{words} "
        chain = chain[:behind] + gap + chain[behind:]
    return chain


def described(one: Error, tolerance: Mapping[str, str], says: str) -> str:
    """The line of an error among the parameters."""
    place = f"behind joint {one.joint}" if one.joint else "at the base"
    about = f"{says} {one.element} {place}".strip()
    return (
        f'{one.name} = {{ unit = "{one.unit}", tolerance = {tolerance[one.unit]}, '
        f'nominal = 0.0, says = "{about}" }}'
    )


def _described(
    text: str,
    owner: tuple[str, str],
    errors: Sequence[Error],
    tolerance: Mapping[str, str],
    says: str,
) -> str:
    lines = "\n".join(described(one, tolerance, says) for one in errors)
    head = f"[{owner[0]}.{owner[1]}.parameters]"
    if head in text:
        at = text.index(head) + len(head)
        end = text.find("\n", at)
        end = len(text) if end < 0 else end
        return f"{text[:end]}\n{lines}{text[end:]}"
    return f"{text.rstrip()}\n\n{head}\n{lines}\n"
