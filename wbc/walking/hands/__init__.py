"""Hands of a robot that walks: their targets, pressing and gripping, and swinging arms.

Each part owns its state, calls the one below it and gets values back; nobody below calls up.

hands       `Hands`: measurement, wrench on all hands, shift of the CoM, slip, the force to which each hand yields
hand        `Hand`: state, contact and grasp of one hand, which leads its arm while it is not free
force       `WristSensor`: readings of the force on a hand, and their tare; `PressForce`: planned force of a hand that
            presses, its help for the balance, and its loss
reaching    `Arms`: swing of the arms, and which joints the balance leaves to them; it moves all arms in a tick
arm         `Arm`: target, reference and task of one hand, and whether a `Hand` occupies it
frames      `TargetFrames`: poses of the frames in which targets are given, of `Arms`; arms read them
"""
