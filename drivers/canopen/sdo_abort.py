"""SDO abort codes (CiA 301) in words, with what to do about those an operator can meet."""

ABORT_WORDS = {
    0x0503_0000: "toggle bit not alternated",
    0x0504_0000: "SDO protocol timed out",
    0x0504_0001: "command specifier not valid",
    0x0504_0005: "out of memory",
    0x0601_0000: "unsupported access to an object",
    0x0601_0001: "attempt to read a write-only object",
    0x0601_0002: "attempt to write a read-only object",
    0x0602_0000: "object does not exist",
    0x0604_0041: "object cannot be mapped to the PDO",
    0x0604_0047: "general internal incompatibility",
    0x0606_0000: "access failed due to a hardware error",
    0x0607_0010: "data type does not match, length of parameter does not match",
    0x0609_0011: "sub-index does not exist",
    0x0609_0030: "value range of parameter exceeded",
    0x0609_0031: "value too high",
    0x0609_0032: "value too low",
    0x060A_0023: "resource not available",
    0x0800_0000: "general error",
    0x0800_0020: "data cannot be transferred or stored",
    0x0800_0021: "data cannot be transferred or stored because of local control",
    0x0800_0022: "data cannot be transferred or stored because of the present device state",
    0x0800_0024: "no data available",
}

REMEDIES = {
    0x0602_0000: "Check that the EDS file belongs to this device.",
    0x0606_0000: "Restore the snapshot, switch the controller off and on and try again.",
    0x0609_0011: "Check that the EDS file belongs to this device.",
    0x0609_0030: "Check the value that was to be written.",
    0x0800_0020: "The old values are still stored; see the controller's manual.",
    0x0800_0022: "Disable motion first, then try again.",
}

UNUSUAL = "See its manual; switch it off and on, and try again."


def abort_words(code: int) -> str:
    """Return what an abort code means, with the code."""
    return f"{ABORT_WORDS.get(code, 'unknown abort code')} (SDO abort 0x{code:08X})"
