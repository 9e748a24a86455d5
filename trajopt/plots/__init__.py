"""Figures, all of one look: trajectories stacked and compared, arcs, the torque-speed plane; results drawn again.

look: colours and styles of every figure · trajectories: `plot`, `compare`, prices, vibration · arcs: of minimum times ·
plane: torque over speed · redraw: what ``trajopt plot`` does. Fronts, plants, axes and profiles have their own.
"""
