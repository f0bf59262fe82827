"""The linear view of a running controller: its loop in contact, margins, and limit cycles in the gap.

`sampled_start` runs the start on the exact plant and keeps every sample; `operating_point` chooses where to
linearise and takes the derivative of the controller's step; `sampled_plant` is the drive at the sample
instants; `systems` holds minimal parts, responses and modes; `loop` joins law and plant and computes the
margins; `limit_cycles` predicts vibrations through the gap and checks them on the exact plant; `view` puts
all of it together.
"""
