"""Writing identified parameters to a controller, and bringing earlier ones back.

``proposal`` says what would be written and what never is, ``gates`` refuses what is not safe,
``transfer`` writes and reads back, ``procedure`` is the whole way with its way back.
"""
