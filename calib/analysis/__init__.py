"""What can be known of a machine before anything is measured, and judged after it is.

``coverage`` spreads poses over the workspace, ``sensitivity`` says how much each error matters,
``identifiability`` which of them readings can tell apart, ``inspection`` whether the description
holds together, ``skeleton`` where the limbs are, ``iso9283`` how well a machine repeats and obeys.
"""
