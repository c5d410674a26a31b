// North over east, drawn by uPlot, both axes to one scale.
import { axis, faded, onTheme } from "/static/chart.js";

const { uPlot } = window;
const LEFT = 58, BOTTOM = 28, TOP = 8, RIGHT = 10; // px around what is drawn
const DOT = 3; // px

// A line, or a dot for each point, of one track's [east, north].
function path(dots) {
  return (u, index) => {
    const [east, north] = u.data[index], drawn = new Path2D(), size = DOT * uPlot.pxRatio;
    east.forEach((e, k) => {
      const x = u.valToPos(e, "x", true), y = u.valToPos(north[k], "y", true);
      if (dots) drawn.rect(x - size / 2, y - size / 2, size, size);
      else if (k) drawn.lineTo(x, y);
      else drawn.moveTo(x, y);
    });
    return dots ? { fill: drawn } : { stroke: drawn };
  };
}

export class Tracks {
  // tracks: [{title, color, dash, dots, hidden, north, east}]
  constructor(figure) {
    this.root = figure.querySelector(".chart");
    this.tracks = [];
    new ResizeObserver(() => this.draw()).observe(this.root);
    onTheme(() => this.draw());
  }

  set(tracks) {
    this.tracks = tracks.filter((track) => !track.hidden && track.east.length);
    this.draw();
  }

  draw() {
    this.chart?.destroy();
    this.chart = null;
    const { clientWidth: width, clientHeight: height } = this.root;
    if (!width || !height || !this.tracks.length) return;
    const [x, y] = this.frame(width - LEFT - RIGHT, height - TOP - BOTTOM);
    this.chart = new uPlot({
      mode: 2, width, height, legend: { show: false }, cursor: { show: false }, padding: [TOP, RIGHT, 0, 0],
      scales: { x: { time: false, range: () => x }, y: { range: () => y } },
      axes: [axis(" m", { space: 70, size: BOTTOM }), axis("", { space: 50, size: LEFT })],
      series: [{}, ...this.tracks.map((track) => ({
        label: track.title, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }],
        stroke: faded(track.color, track.alpha), fill: faded(track.color, track.alpha), width: 1.6, dash: track.dash?.length ? track.dash : undefined,
        points: { show: false }, paths: path(track.dots),
      }))],
    }, [null, ...this.tracks.map((track) => [track.east, track.north])], this.root);
  }

  // Ranges of east and north that hold all points, a metre as long in both.
  frame(width, height) {
    let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const track of this.tracks) {
      for (let k = 0; k < track.east.length; k++) {
        west = Math.min(west, track.east[k]); east = Math.max(east, track.east[k]);
        south = Math.min(south, track.north[k]); north = Math.max(north, track.north[k]);
      }
    }
    const metre = Math.max((east - west) / width, (north - south) / height, 0.01 / width) * 1.08;
    const around = (low, high, size) => [(low + high - metre * size) / 2, (low + high + metre * size) / 2];
    return [around(west, east, width), around(south, north, height)];
  }
}
