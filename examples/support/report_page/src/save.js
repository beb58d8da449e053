// Figures as PNG files, with their titles and legends, on the colour of the page.
import { colour, element } from './dom.js';

/** What the legend beside a figure says of all that is shown: name, colour, and the dashes of a line. */
function legendOf(body) {
  const rows = [...body.querySelectorAll('.key, .u-series')].filter((row) => {
    const box = row.querySelector('input');
    return row.querySelector('svg, i') && (box ? box.checked : !row.classList.contains('u-off'));
  });
  return rows.map((row) => {
    const line = row.querySelector('svg line');
    const name = row.querySelector('.u-label') ?? row;
    return {
      name: name.textContent,
      ink: line ? getComputedStyle(line).stroke : getComputedStyle(row.querySelector('i')).backgroundColor,
      dashes: line ? (line.getAttribute('stroke-dasharray') ?? '').split(' ').map(Number).filter((length) => length > 0) : null,
    };
  });
}

/** Draws the legend's entries in rows from (left, top) on, or only measures them; returns how high they are. */
function drawLegend(ctx, legend, left, top, width, scale, draw) {
  ctx.font = `${13 * scale}px system-ui, sans-serif`;
  let x = left;
  let y = top;
  for (const { name, ink, dashes } of legend) {
    const size = 36 * scale + ctx.measureText(name).width + 18 * scale;
    if (x > left && x + size > left + width) {
      x = left;
      y += 20 * scale;
    }
    if (draw) {
      ctx.strokeStyle = ink;
      ctx.fillStyle = ink;
      ctx.lineWidth = 3 * scale;
      ctx.setLineDash((dashes ?? []).map((length) => length * scale));
      ctx.beginPath();
      if (dashes) {
        ctx.moveTo(x, y + 10 * scale);
        ctx.lineTo(x + 30 * scale, y + 10 * scale);
        ctx.stroke();
      } else {
        ctx.arc(x + 15 * scale, y + 10 * scale, 4.5 * scale, 0, 2 * Math.PI);
        ctx.fill();
      }
      ctx.fillStyle = colour('text');
      ctx.fillText(name, x + 36 * scale, y + 14.5 * scale);
    }
    x += size;
  }
  return legend.length > 0 ? y + 22 * scale - top : 0;
}

function composed(canvas, title, legend) {
  const scale = devicePixelRatio;
  const head = 34 * scale;
  // As large as it is shown: a heat map has one pixel a cell.
  const width = Math.max(canvas.width, Math.round(canvas.clientWidth * scale));
  const height = Math.round((canvas.height * width) / canvas.width);
  const sheet = element('canvas', { width: width + 16 * scale });
  const ctx = sheet.getContext('2d');
  const foot = drawLegend(ctx, legend, 8 * scale, 0, width, scale, false);
  sheet.height = height + head + foot + 8 * scale;
  ctx.fillStyle = colour('card');
  ctx.fillRect(0, 0, sheet.width, sheet.height);
  ctx.fillStyle = colour('text');
  ctx.font = `600 ${16 * scale}px system-ui, sans-serif`;
  ctx.fillText(title, 8 * scale, 22 * scale);
  ctx.imageSmoothingEnabled = false;
  ctx.drawImage(canvas, 8 * scale, head, width, height);
  drawLegend(ctx, legend, 8 * scale, head + height + 4 * scale, width, scale, true);
  return sheet;
}

/** The photograph with the marks that are shown over it, in whole pixels of its own, at least as large as it is shown. */
async function photograph(picture) {
  const image = picture.querySelector('img');
  const marks = picture.querySelector('svg').cloneNode(true);
  // Away from the page the marks have neither its colours nor the rule by which their width is that of the screen.
  const shown = picture.querySelectorAll('g');
  marks.querySelectorAll('g').forEach((group, i) => {
    group.setAttribute('stroke', getComputedStyle(shown[i].firstChild).stroke);
    group.setAttribute('fill', 'none');
    group.setAttribute('stroke-linecap', 'round');
  });
  const times = Math.max(1, Math.ceil(image.clientWidth / image.naturalWidth));
  const [width, height] = [times * image.naturalWidth, times * image.naturalHeight];
  marks.setAttribute('width', width);
  marks.setAttribute('height', height);
  const drawn = new Image();
  drawn.src = `data:image/svg+xml,${encodeURIComponent(new XMLSerializer().serializeToString(marks))}`;
  await drawn.decode();
  const canvas = element('canvas', { width, height });
  const ctx = canvas.getContext('2d');
  ctx.imageSmoothingEnabled = false;
  ctx.drawImage(image, 0, 0, width, height);
  ctx.drawImage(drawn, 0, 0);
  return canvas;
}

/** A button that saves what the panel's canvas or picture shows; null where it has none. */
export function saveButton(panel, body) {
  const canvas = body.querySelector('canvas');
  const picture = body.querySelector('.picture');
  if (!canvas && !picture) return null;
  const button = element('button', { type: 'button', className: 'save', title: `Save "${panel.title}" as a PNG file` }, 'PNG');
  button.addEventListener('click', async () => {
    canvas?.dispatchEvent(new Event('beforesave')); // a canvas of WebGL is empty until it is drawn again
    composed(canvas ?? (await photograph(picture)), panel.title, legendOf(body)).toBlob((png) => {
      const link = element('a', { href: URL.createObjectURL(png), download: `${panel.title.replace(/[^\w.-]+/g, '_')}.png` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  });
  return button;
}
