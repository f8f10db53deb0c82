"""What all tests share: neither the machine's load nor the way they are started decides."""

import signal

from hypothesis import settings

# A shell starts what runs in the background deaf to Ctrl-C, nohup to a hang-up, and the tests'
# children with it.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, lambda *_: None)

settings.register_profile("legato", deadline=None)
settings.load_profile("legato")
