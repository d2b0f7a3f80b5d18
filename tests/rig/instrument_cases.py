"""Instruments of the tests: a plan with their tables, a Modbus server, a chamber on a CAN bus."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from pathlib import Path

from rig_cases import BENCH, SHORT_PLAN, bench_unit, description

from triaxcal.rig.plan.plan import SessionPlan, read_plan
from triaxcal.rig.session.engine import Engine, Setup

SIMULATED = f"{Path(__file__).parent / 'instruments.yaml'}@sim"


def plan_with(folder: Path, tables: str, temps: str = "[20, 25]") -> SessionPlan:
    """The short plan with tables of the equipment."""
    path = folder / "plan.toml"
    plan = SHORT_PLAN.format(rate=100, layout="classic", temps=temps, take="false")
    path.write_text(plan + tables, encoding="utf-8")
    return read_plan(path, bench_unit())


def setup_with(folder: Path, tables: str, temps: str = "[20, 25]") -> Setup:
    """Setup of the short plan with tables of the equipment."""
    plan = plan_with(folder, tables, temps)
    return Setup(BENCH, bench_unit(), plan, description(plan.rig))


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def modbus_server(registers: list[int]):
    """Port of a Modbus TCP server on loopback whose holding and input registers are these."""
    from pymodbus.datastore import (
        ModbusDeviceContext,
        ModbusSequentialDataBlock,
        ModbusServerContext,
    )
    from pymodbus.server import ModbusTcpServer

    port, up, loop = free_port(), threading.Event(), asyncio.new_event_loop()
    made = []

    async def serve():
        block = ModbusSequentialDataBlock(1, registers)
        context = ModbusServerContext(ModbusDeviceContext(hr=block, ir=block))
        made.append(ModbusTcpServer(context, address=("127.0.0.1", port)))
        await made[0].serve_forever(background=True)
        up.set()

    def run():
        loop.run_until_complete(serve())
        loop.run_forever()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert up.wait(20)
    try:
        yield port
    finally:
        asyncio.run_coroutine_threadsafe(made[0].shutdown(), loop).result(20)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(20)
        loop.close()


def walk(setup: Setup, rig, attendant, limit_s=4000, each=lambda: None):
    """Walk the plan without a person; events, and what attendant said with the second."""
    engine, events, said = Engine(setup, "test"), [], []
    while not engine.session.done:
        assert rig.seconds < limit_s, f"not done after {limit_s} s: {said[-3:]}"
        new = engine.feed(rig.advance())
        each()
        events += new
        try:
            attendant.act(engine.session, new)
        finally:
            said += [(rig.seconds, text) for text in attendant.notes()]
    return engine, events, said
