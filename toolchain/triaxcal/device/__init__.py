"""What the unit at the other end of a cable is told and asked, over XCP on CAN.

pyxcp is the master. The node is a firmware with `firmware_ref/xcp`, whose headers say what is at
which address.
"""
