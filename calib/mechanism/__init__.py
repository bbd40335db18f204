"""Any mechanism from one description: kinematics, error Jacobians and limits, all derived."""
