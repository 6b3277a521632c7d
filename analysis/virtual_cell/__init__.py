"""The virtual weld cell: the paper's rig with known truth, as a recording source.

Frames, millimetres inside this package. The *fixed* frame stands with camera and robot: X across
the seam, y along the robot's travel, z up; the torch works at X = 0. The *table* frame lies on
the workpiece, parallel to the fixed one and moved by the table's travel q (sign of the encoder):

    X = x + q

A seam at table coordinate x = f(y) is under the torch when q = -f(y), so the reference of the
table is -f(y). The torch's path on the plate is x = -q, and with e = reference - q it lies e beside
the seam. Seen from above with y to the right, x points down: rows of a picture grow with x,
columns with y.
"""
