"""A server of OPC UA that no one here wrote (asyncua), driven by lines of standard input.

Arguments: port, then names of variables of Double in namespace 2; one that begins with `f:` is a Float, with `b:` a
Boolean. Lines: `set NAME VALUE SECONDS STATUS` (SECONDS since 1970 at the source, STATUS a code such as 0), `get NAME`,
which prints the value, the status and the seconds at the source, and `?`, which prints `there`. Prints `ready` at first.
"""

import asyncio
import sys
from datetime import datetime, timedelta, timezone

from asyncua import Server, ua

START = datetime(1970, 1, 1, tzinfo=timezone.utc)


def at(seconds: float) -> datetime:
    return START + timedelta(microseconds=round(seconds * 1e6))


async def main() -> None:
    port, names = int(sys.argv[1]), sys.argv[2:]
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/plant/")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    space = await server.register_namespace("urn:plant")
    assert space == 2, space
    nodes, kinds = {}, {}
    for name in names:
        kind, value = ua.VariantType.Double, 0.0
        if name.startswith("f:"):
            name, kind = name[2:], ua.VariantType.Float
        elif name.startswith("b:"):
            name, kind, value = name[2:], ua.VariantType.Boolean, False
        nodes[name] = await server.nodes.objects.add_variable(
            ua.NodeId(name, space), name, value, varianttype=kind
        )
        kinds[name] = kind
        await nodes[name].set_writable()
        # nothing was read so far
        empty = ua.DataValue(ua.Variant(value, kind), ua.StatusCode(ua.StatusCodes.BadWaitingForInitialData))
        await nodes[name].write_value(empty)
    async with server:
        print("ready", flush=True)
        loop = asyncio.get_running_loop()
        while line := await loop.run_in_executor(None, sys.stdin.readline):
            match line.split():
                case ["set", name, value, seconds, status]:
                    number = bool(float(value)) if kinds[name] == ua.VariantType.Boolean else float(value)
                    new = ua.DataValue(
                        ua.Variant(number, kinds[name]),
                        ua.StatusCode(int(status, 0)),
                        SourceTimestamp=at(float(seconds)),
                    )
                    await nodes[name].write_value(new)
                case ["get", name]:
                    held = await nodes[name].read_data_value(raise_on_bad_status=False)
                    when = held.SourceTimestamp
                    seconds = (when.replace(tzinfo=timezone.utc) - START).total_seconds() if when else "-"
                    print(held.Value.Value, held.StatusCode.value, seconds, flush=True)
                case ["?"]:
                    print("there", flush=True)


asyncio.run(main())
