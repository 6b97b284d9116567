// The WebSocket: requests with their answers, and what comes by itself. Comes back when the panel does.

export class Link {
  constructor(onMessage, onState) {
    this.onMessage = onMessage;
    this.onState = onState;
    this.waiting = new Map();
    this.next = 1;
    this.watch = { live: true, truth: false };
    this.open();
  }

  open() {
    this.socket = new WebSocket(`ws://${location.host}/ws`);
    this.socket.onopen = () => { this.onState("connected"); this.sendWatch(); };
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
    this.socket.onclose = (event) => {
      for (const { fail } of this.waiting.values()) fail(new Error("the panel is gone"));
      this.waiting.clear();
      this.onState(event.reason ? `closed: ${event.reason}` : "the panel is gone; trying again");
      setTimeout(() => this.open(), 1000);
    };
  }

  take(message) {
    const waiting = this.waiting.get(message.id);
    if (waiting) {
      this.waiting.delete(message.id);
      if (message.error) waiting.fail(new Error(message.error)); else waiting.done(message);
    }
    if (message.kind !== "answer") this.onMessage(message);
  }

  ask(request) {
    return new Promise((done, fail) => {
      if (this.socket.readyState !== WebSocket.OPEN) { fail(new Error("not connected")); return; }
      const id = this.next++;
      this.waiting.set(id, { done, fail });
      this.socket.send(JSON.stringify({ id, ...request }));
    });
  }

  say(line) { return this.ask({ do: "line", line }); }

  sendWatch(change = {}) {
    Object.assign(this.watch, change);
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ do: "watch", ...this.watch }));
  }
}
