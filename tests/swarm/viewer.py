"""A viewer on Foxglove's WebSocket, written with PyPI `websockets`, which shares no line with the server.

Reads orders, one JSON object a line, and prints what it hears, one JSON object a line.
"""

import asyncio
import base64
import json
import struct
import sys

import websockets


def say(**what):
    print(json.dumps(what), flush=True)


async def main(url):
    channels, topics, subscriptions, services = {}, {}, {}, {}
    async with websockets.connect(url, subprotocols=["foxglove.sdk.v1"]) as socket:
        say(event="connected", subprotocol=socket.subprotocol)

        async def hear():
            async for message in socket:
                if isinstance(message, bytes):
                    if message[0] == 1:
                        number, at = struct.unpack_from("<IQ", message, 1)
                        channel = channels[subscriptions[number]]
                        data = message[13:]
                        body = json.loads(data) if channel["encoding"] == "json" else base64.b64encode(data).decode()
                        say(event="message", topic=channel["topic"], at=at, body=body)
                    elif message[0] == 3:
                        service, call, length = struct.unpack_from("<III", message, 1)
                        encoding = message[13 : 13 + length].decode()
                        body = json.loads(message[13 + length :])
                        say(event="response", service=service, call=call, encoding=encoding, body=body)
                    else:
                        say(event="unknown", opcode=message[0])
                    continue
                told = json.loads(message)
                if told["op"] == "advertise":
                    for channel in told["channels"]:
                        channels[channel["id"]] = channel
                        topics[channel["topic"]] = channel["id"]
                        if channel["schemaEncoding"] == "jsonschema":
                            json.loads(channel["schema"])
                        else:
                            base64.b64decode(channel["schema"], validate=True)
                    say(event="advertise", topics=[channel["topic"] for channel in told["channels"]])
                elif told["op"] == "advertiseServices":
                    services.update({service["name"]: service["id"] for service in told["services"]})
                    say(event="services", names=list(services))
                else:
                    say(event=told["op"], told=told)

        async def obey():
            loop, calls = asyncio.get_running_loop(), 0
            while line := await loop.run_in_executor(None, sys.stdin.readline):
                order = json.loads(line)
                if order["do"] == "subscribe":
                    number = len(subscriptions) + 1
                    subscriptions[number] = topics[order["topic"]]
                    one = {"id": number, "channelId": topics[order["topic"]]}
                    await socket.send(json.dumps({"op": "subscribe", "subscriptions": [one]}))
                elif order["do"] == "graph":
                    await socket.send(json.dumps({"op": "subscribeConnectionGraph"}))
                elif order["do"] == "call":
                    calls += 1
                    head = struct.pack("<BIII", 2, services[order["service"]], calls, 4)
                    await socket.send(head + b"json" + json.dumps(order["request"]).encode())
                elif order["do"] == "quit":
                    await socket.close()
                    return

        done, rest = await asyncio.wait(
            [asyncio.ensure_future(hear()), asyncio.ensure_future(obey())], return_when=asyncio.FIRST_COMPLETED
        )
        for task in rest:
            task.cancel()
        for task in done:
            task.result()
        say(event="closed", code=socket.close_code)


asyncio.run(main(sys.argv[1]))
