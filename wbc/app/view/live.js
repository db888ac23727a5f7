let socket = null;
const byId = (id) => document.getElementById(id);
let mayChange = false;
const tell = (wish) => {
    const open = mayChange && socket && socket.readyState === 1;
    if (open) socket.send(JSON.stringify(wish));
    return open;
};
const order = (wish) => tell({order: wish});

// ---- what can be changed depends on the run; it says so when the connection is made

function build(controls) {
    const place = byId("change");
    place.replaceChildren();
    fastest = null;
    byId("pause").disabled = byId("speed").disabled = !mayChange;
    if (!mayChange) { place.append("to change the run, open the link that it has printed"); return; }
    if (controls.drive) { drive(controls.drive, place); make("span", place, {id: "driver"}); }
    if (!controls.stop) return;
    const [label, title] = controls.drive
        ? ["stand", "the robot comes to a stand and can be driven on; end the run in its terminal with Ctrl-C"]
        : ["stop walking", "the present step is the last; the run ends when the robot stands"];
    make("button", place, {id: "stop", title}, label).onclick = () => order({do: "stop"});
}

// ---- arrow keys (with shift to the side) drive as the stick does

const typing = (event) => ["SELECT", "INPUT"].includes(event.target.tagName);
document.addEventListener("keydown", (event) => {
    if (!fastest || typing(event)) return;
    if (event.key === "Shift" || event.key.startsWith("Arrow")) {
        if (event.key !== "Shift") event.preventDefault();
        held.add(event.key);
    }
}, true);
document.addEventListener("keyup", (event) => held.delete(event.key), true);
window.addEventListener("blur", () => held.clear());
let paused = false;
byId("pause").onclick = () => tell({paused: !paused});
byId("speed").onchange = (event) => {
    tell({speed: event.target.value === "" ? null : Number(event.target.value)});
};
document.addEventListener("keydown", (event) => {
    if (event.key === " " && !["SELECT", "INPUT", "BUTTON"].includes(event.target.tagName)) {
        event.preventDefault();
        tell({paused: !paused});
    }
});
function state(facts) {
    paused = facts.paused;
    otherDrives = facts.other_drives;
    if (byId("driver")) say("driver", facts.other_drives ? "another page drives" : "");
    byId("pause").textContent = paused ? "go on" : "pause";
    const speed = facts.speed === null ? "" : String(facts.speed), select = byId("speed");
    if (![...select.options].some((option) => option.value === speed)) make("option", select, {value: speed}, speed);
    select.value = speed;
}

// ---- frames

// The camera lives in a frame with y up: (x, z, -y) of the world. It follows slowly: hips sway.
const FOLLOW = 0.15;
let seen = null;
function follow(target) {
    const from = seen === null ? [0, 0, START_HEIGHT] : seen;
    const share = seen === null ? 1 : FOLLOW;
    const by = target.map((value, i) => share * (value - from[i]));
    seen = from.map((value, i) => value + by[i]);
    if (!byId("follow").checked) return;
    for (const place of [viewer.camera.position, viewer.controls.target]) {
        place.x += by[0]; place.y += by[2]; place.z -= by[1];
    }
    viewer.controls.update();
}
function bend(path, numbers) {
    // Vertices are moved where they are: an object made anew with each frame would be slow, and flicker.
    let node = viewer.scene_tree;
    for (const name of [...path.split("/").filter((part) => part), "0", "<object>"]) {
        node = node.children[name];
        if (node === undefined) return;
    }
    const geometry = node.object.geometry;
    const places = geometry && geometry.attributes.position;
    if (!places || places.array.length !== numbers.length) return;
    places.array.set(numbers);
    places.needsUpdate = true;
    geometry.computeBoundingSphere();
}
function facts(said) {
    say("time", said.time.toFixed(2) + " s");
    say("text", said.text || "");
    state(said);
    for (const [path, numbers] of Object.entries(said.shapes || {})) bend(path, numbers);
    if (said.target) follow(said.target);
    viewer.set_dirty();
}
function connect() {
    socket = new WebSocket(`ws://${location.host}/stream${location.search}`);  // with the token of the link
    socket.binaryType = "arraybuffer";
    socket.onopen = () => say("state", "");
    socket.onmessage = (message) => {
        if (typeof message.data !== "string") { take(message.data); return; }
        const said = JSON.parse(message.data);
        if (!said.hello) { facts(said); return; }
        if (said.hello.page !== PAGE_KEY) { location.reload(); return; }
        mayChange = said.hello.may_change;
        build(said.hello.controls);
    };
    // The next run on the same port goes on in the same page.
    socket.onclose = () => {
        say("state", "(ended)");
        byId("change").replaceChildren();
        setTimeout(connect, 1000);
    };
}
connect();
