(() => {
  const drive = JSON.parse(document.getElementById("drive").textContent);
  const canvas = document.getElementById("player"), pen = canvas.getContext("2d");
  const slider = document.getElementById("at"), button = document.getElementById("play"), now = document.getElementById("now");
  const scale = canvas.width / 160, last = drive.ego.length - 1;
  slider.max = last;
  const between = (a, b, share) => a.map((value, i) => {
    if (i !== 2) return value + share * (b[i] - value);
    return value + share * Math.atan2(Math.sin(b[2] - value), Math.cos(b[2] - value));
  });
  const box = (x, y, heading, length, width, colour) => {
    pen.save(); pen.translate(x, y); pen.rotate(heading); pen.fillStyle = colour;
    pen.fillRect(-length / 2, -width / 2, length, width); pen.restore();
  };
  const fill = (rings, colour) => {
    pen.fillStyle = colour;
    for (const ring of rings) {
      pen.beginPath(); ring.forEach(([x, y]) => pen.lineTo(x, y)); pen.fill();
    }
  };
  const draw = at => {
    const frame = Math.min(Math.floor(at), last - 1), share = at - frame;
    const ego = between(drive.ego[frame], drive.ego[frame + 1], share);
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.fillStyle = "#fff"; pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.translate(canvas.width * 0.4, canvas.height / 2); pen.scale(scale, -scale); pen.rotate(-ego[2]); pen.translate(-ego[0], -ego[1]);
    fill(drive.areas.pavement, "#f4f4f4"); fill(drive.areas.drivable, "#dcdcdc"); fill(drive.areas.closed_area, "#f3d9a6");
    pen.fillStyle = "#D55E00";
    for (const [x, y, radius] of drive.devices) {
      pen.beginPath(); pen.arc(x, y, Math.max(radius, 0.35), 0, 7); pen.fill();
    }
    const next = new Map(drive.others[frame + 1].map(other => [other[3], other]));
    for (const other of drive.others[frame]) {
      const [x, y, heading, , length, width] = next.has(other[3]) ? between(other, next.get(other[3]), share) : other;
      box(x, y, heading, length, width, "#0072B2");
    }
    box(ego[0], ego[1], ego[2], drive.size[0], drive.size[1], "#000");
    now.textContent = `${(at * drive.frame_s).toFixed(1)} s, ${ego[3].toFixed(1)} m/s`;
    slider.value = at;
  };
  let playing = false, at = 0, before = 0;
  const step = time => {
    if (!playing) return;
    at = Math.min(at + 4 * (time - before) / 1000 / drive.frame_s, last); before = time; draw(at);
    if (at >= last) { playing = false; button.textContent = "Play again"; } else requestAnimationFrame(step);
  };
  button.onclick = () => {
    playing = !playing; button.textContent = playing ? "Pause" : "Play";
    if (at >= last) at = 0;
    if (playing) { before = performance.now(); requestAnimationFrame(step); }
  };
  slider.oninput = () => { at = Number(slider.value); draw(at); };
  draw(at = last * 0.55);
})();
