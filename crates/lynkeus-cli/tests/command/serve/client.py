"""A client of an MQTT broker that no one here wrote: publishes what standard input says, prints what it hears.

Arguments: port, topic to hear, and a file of certificates for TLS, if any. A line of standard input is a topic, a
space, flags (r: retained, or -), a space and a payload; each is published at least once, and the broker has it before
the next line is read. Prints `ready` once it hears, `there` once a line `?` is read, and each payload heard.
"""

import sys
import time

import paho.mqtt.client as mqtt

port, heard = int(sys.argv[1]), sys.argv[2]
client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id=f"test-{heard}", clean_session=False)
if len(sys.argv) > 3:
    client.tls_set(ca_certs=sys.argv[3])


def say(text: str) -> None:
    print(text, flush=True)


published: set[int] = set()
client.on_publish = lambda _, __, mid, *___: published.add(mid)
client.on_connect = lambda c, *_: c.subscribe(heard, qos=1)
client.on_subscribe = lambda *_: say("ready")
client.on_message = lambda _, __, message: say(message.payload.decode())
client.reconnect_delay_set(1, 1)
for _ in range(200):
    try:
        client.connect("localhost", port)
        break
    except OSError:
        time.sleep(0.05)
client.loop_start()
for line in sys.stdin:
    if line.strip() == "?":
        say("there")
        continue
    topic, flags, payload = line.rstrip("\n").split(" ", 2)
    sent = client.publish(topic, payload.encode("utf-8", "surrogateescape"), qos=1, retain="r" in flags)
    # the broker may be away: then it is sent once it is there
    while sent.mid not in published:
        time.sleep(0.001)
client.loop_stop()
client.disconnect()
