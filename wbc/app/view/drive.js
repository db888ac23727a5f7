// Driving by a stick on the page or a gamepad, and by keys that are held: a command is sent when it changes.
// The page that takes this in has `order(wish)`, true if the wish was sent.

function make(tag, parent, attributes = {}, text = "") {
    const made = parent.appendChild(document.createElement(tag));
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(text);
    return made;
}
let fastest = null, sent = "", otherDrives = false, held = new Set(), stick = [0, 0], knob = null;
const ROUND = "display: inline-flex; align-items: center; justify-content: center; box-sizing: border-box;";
function drive(limits, place) {
    fastest = limits;
    held.clear();
    sent = "";
    stick = [0, 0];
    const pad = make("span", place, {
        id: "stick", title: "drive: drag, or use a gamepad; in the live view arrow keys as well, with shift to the side",
        style: `${ROUND} width: 58px; height: 58px; border-radius: 29px; border: 1px solid #888; touch-action: none; cursor: grab`});
    knob = make("span", pad, {
        id: "knob", style: "width: 22px; height: 22px; border-radius: 11px; background: #4477aa; pointer-events: none"});
    const move = (event) => {
        const box = pad.getBoundingClientRect(), half = box.width / 2;
        const limit = (value) => Math.max(-1, Math.min(1, value / half));
        stick = [limit(event.clientX - box.left - half), limit(event.clientY - box.top - half)];
    };
    pad.onpointerdown = (event) => { pad.setPointerCapture(event.pointerId); move(event); };
    pad.onpointermove = (event) => { if (pad.hasPointerCapture(event.pointerId)) move(event); };
    pad.onpointerup = pad.onpointercancel = () => { stick = [0, 0]; };
}
function steer() {
    if (!fastest) return;
    const key = (name) => (held.has(name) ? 1 : 0), free = (value) => (Math.abs(value) > 0.15 ? value : 0);
    let ahead = key("ArrowUp") - key("ArrowDown") - free(stick[1]), left = 0, turn = -free(stick[0]);
    const side = key("ArrowLeft") - key("ArrowRight");
    if (held.has("Shift")) left += side; else turn += side;
    for (const pad of navigator.getGamepads ? navigator.getGamepads() : []) {
        if (!pad || !pad.connected) continue;
        ahead -= free(pad.axes[1] || 0); left -= free(pad.axes[0] || 0); turn -= free(pad.axes[2] || 0);
    }
    const inside = (value) => 20 * Math.max(-1, Math.min(1, value));
    knob.style.transform = `translate(${inside(-(left || turn))}px, ${inside(-ahead)}px)`;
    const part = (value, most) => Math.round(100 * Math.max(-1, Math.min(1, value)) * most) / 100;
    const wish = {do: "drive", forward: part(ahead, ahead > 0 ? fastest.forward : fastest.back),
                  left: part(left, fastest.left), turn: part(turn, fastest.turn)};
    const text = JSON.stringify(wish);
    if (otherDrives && !wish.forward && !wish.left && !wish.turn) sent = text;  // nor stops what the other page drives
    if (text === sent || (sent === "" && !wish.forward && !wish.left && !wish.turn)) return;
    if (order(wish)) sent = text;
}
setInterval(steer, 100);
