"""The strategies of softstart, one file each, and what they share.

    direct, ramp, s_curve, profile      torque over time, without any measurement
    reduced                             the law of [G], its reduced torque and its delay, which three follow:
                                        reduced_first_stage, reduced_two_stage, acceleration_delay
    landing                             closes the gap softly; what follows contact is
                                        current_limit_feedback, shaped (shaping), state_feedback (regulator)
    pulse_coast_hold                    the optimal start as feedback
    take_up                             several gaps (shaft_observer)

`contact` is the estimator of those that land softly or coast: when the gap closed, and motor, shaft and
load from then on (shaft_filter: its two Kalman filters). `sampled` has the parameters that many have.
"""
