// The page of a study: a table to sort and filter, and a plot of any two columns; a row shows its command.
'use strict';

(() => {
  const data = JSON.parse(document.getElementById('data').textContent);
  const most = 400;
  const choice = (label, names, value, change) => {
    const out = element('select', {'aria-label': label, change: () => change()}, names.map(name => element('option', {}, name)));
    if (value !== undefined) out.value = value;
    return element('label', {class: 'dim'}, `${label} `, out);
  };
  const valueOf = label => label.querySelector('select').value;

  /** Axes that suit a study; else its first two columns of numbers. */
  const usual = {'accuracy.csv': ['cpu_seconds_per_second', /^rate_error_rms/, 'method', true, true], 'effects.csv': ['saved_per_step[ns]', /^angle_rms|^displacement/, 'effect_taken_away', false, false],
    'stability.csv': ['cpu[s]', /^measured/, 'verdict', true, true], 'grasps.csv': ['normal_force[N]', /^margin/, 'held', false, false],
    'validate.csv': ['measured', /^ours/, 'verdict', true, true]};

  /** Fields of the lines of a CSV file: nothing, numbers with the digits that the page shows, else texts. */
  const field = text => {
    const bare = text.startsWith('"') ? text.slice(1, -1).replaceAll('""', '"') : text;
    return bare === '' ? null : bare.trim() && isFinite(bare) ? Number(Number(bare).toPrecision(7)) : bare;
  };
  const read = csv => csv.replace(/\n$/, '').split('\n').map(line => Array.from(`${line},`.matchAll(/("(?:[^"]|"")*"|[^,]*),/g), part => field(part[1])));

  function section(table) {
    const [columns, ...rows] = read(table.csv), items = rows.map((cells, index) => ({cells, index}));
    const commands = (data.study.rows || {})[table.name], template = (data.study.templates || {})[table.name];
    const pages = columns[0] === 'scene' && columns[1] === 'side' ? rows.map(([scene, side]) => [`${scene}_${side}`, scene].find(name => data.pages.includes(name))) : [];
    const page = item => pages[item.index] && `${encodeURIComponent(pages[item.index])}/report.html`;
    const numeric = columns.filter((_, c) => rows.some(r => typeof r[c] === 'number') && rows.every(r => r[c] === null || typeof r[c] === 'number'));
    const groups = columns.filter((name, c) => !numeric.includes(name) || new Set(rows.map(r => r[c])).size <= 6);
    const [x, y, group, logX, logY] = usual[table.name] || [];
    const holds = ['held', 'verdict', 'outcome', 'method'].find(name => groups.includes(name));
    const first = numeric.filter(name => !/^(rollout|held)$/.test(name) && !name.endsWith('.held'));
    const axisX = choice('x', numeric, numeric.includes(x) ? x : first[0], draw);
    const axisY = choice('y', numeric, (y && numeric.find(name => y.test(name))) || first[1] || first[0], draw);
    const grouped = choice('colour', ['none', ...groups], groups.includes(group) ? group : holds || 'none', draw);
    const tick = (label, on) => { const box = element('input', {type: 'checkbox', change: () => draw()}); box.checked = !!on; return element('label', {class: 'dim'}, box, ` ${label}`); };
    const boxX = tick('log x', logX), boxY = tick('log y', logY);
    const filter = element('input', {type: 'search', placeholder: 'filter rows', 'aria-label': 'filter rows', input: () => draw()});
    const count = element('span', {class: 'dim'}), legend = element('div', {class: 'bar dim'}), told = element('p', {'aria-live': 'polite'});
    let all = false;
    const more = element('button', {type: 'button', click: () => { all = true; draw(); }}, 'show all rows');

    const command = item => {
      if (commands) return commands[item.index] || '';
      if (template) return template.replace(/\{([^}]*)\}/g, (_, name) => item.cells[columns.indexOf(name)]);
      return '';
    };
    const shown = columns.map((name, c) => ({name, value: item => item.cells[c], number: numeric.includes(name)}));
    if (pages.some(Boolean)) shown.push({name: 'run', value: page, show: item => page(item) ? element('a', {href: page(item)}, 'open') : ''});
    const grid = Table.sortable(shown, pick), plot = Curves.scatter(pick);

    function pick(item) {
      grid.mark(item);
      plot.mark(item);
      const text = command(item);
      told.replaceChildren(...(text ? ['Repeat this row: ', element('code', {}, text), ' ',
        element('button', {type: 'button', click: () => navigator.clipboard && navigator.clipboard.writeText(text)}, 'copy')]
        : page(item) ? ['Its run: ', element('a', {href: page(item)}, page(item))] : ['No command is known for this row.']));
    }
    function draw() {
      const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
      const list = items.filter(item => words.every(word => item.cells.some(cell => String(cell).toLowerCase().includes(word))));
      grid.rows(all ? list : list.slice(0, most));
      more.hidden = all || list.length <= most;
      count.textContent = `${list.length} of ${items.length} rows${more.hidden ? '' : `, ${most} shown`}`;
      const c = columns.indexOf(valueOf(grouped)), names = c < 0 ? [] : [...new Set(items.map(item => item.cells[c]))];
      const ix = columns.indexOf(valueOf(axisX)), iy = columns.indexOf(valueOf(axisY));
      const number = v => v === null ? NaN : v;
      plot.show(list.map(item => {
        const g = c < 0 ? 0 : names.indexOf(item.cells[c]);
        return {x: number(item.cells[ix]), y: number(item.cells[iy]), colour: Curves.palette[g % Curves.palette.length], shape: Math.floor(g / Curves.palette.length) + g, row: item};
      }), {x: columns[ix], y: columns[iy], logX: boxX.querySelector('input').checked, logY: boxY.querySelector('input').checked});
      legend.replaceChildren(...names.slice(0, 40).map((name, g) => {
        const mark = element('canvas', {width: 14, height: 14});
        Curves.symbol(mark.getContext('2d'), 7, 7, Math.floor(g / Curves.palette.length) + g, 5, Curves.palette[g % Curves.palette.length], false);
        return element('span', {}, mark, ' ', `${columns[c]} ${Table.text(name)}`.replace(/^(method|way|effect_taken_away|outcome) /, ''));
      }));
    }
    const out = element('section', {}, element('h2', {}, table.name.replace('.csv', '').replace('_', ' ')),
      numeric.length ? [element('div', {class: 'bar'}, axisX, axisY, grouped, boxX, boxY), plot.element, legend] : null,
      told, element('div', {class: 'bar'}, filter, count, more), grid.element);
    return {out, draw, pick, items};
  }

  /** Curves of drawn hands, of one kind at a time: medians, with the middle nine of ten as bands. */
  function bands(csv) {
    const [columns, ...rows] = read(csv), times = rows.map(row => row[0]), span = [times[0], times[times.length - 1]], kinds = new Map();
    const parts = ['thumb', 'index', 'middle', 'ring', 'little', 'palm', 'wrist', 'forearm'];
    for (let c = 1; c < columns.length; c += 3) {
      const [, full, , unit] = /^(.*)\.p5(\[(.*)\])?$/.exec(columns[c]), [low, values, high] = [0, 1, 2].map(i => rows.map(row => (unit === 'rad' ? 180 / Math.PI : 1) * row[c + i]));
      if (low.every(v => v === 0) && high.every(v => v === 0)) continue;
      const kind = full.endsWith('.torque') ? 'torques' : full.startsWith('activation.') ? 'activations' : full.startsWith('force.') ? 'contact forces' : 'angles';
      let words = full.replace(/^(activation|force)\.|\.torque$/g, '');
      const part = parts.find(p => words.includes(p)) || '';
      if (kind === 'activations') words = words.replace(`${part}.`, '');
      // A plot for each part of each hand.
      const place = `${words.split('.')[0]} ${kind === 'contact forces' ? 'hand' : part}`;
      if (!kinds.has(kind)) kinds.set(kind, new Map());
      const groups = kinds.get(kind);
      if (!groups.has(place)) groups.set(place, {unit: (unit || '').replace('rad', 'deg').replace('_', ' '), list: []});
      const list = groups.get(place).list;
      list.push({name: words.replace(/^[^.]*\./, ''), times, values, low, high, colour: Curves.palette[list.length % Curves.palette.length]});
    }
    let plots = [];
    const kind = choice('curves', [...kinds.keys()], kinds.has('torques') ? 'torques' : undefined, show), box = element('div', {class: 'bands'});
    function show() {
      plots = [...kinds.get(valueOf(kind))].map(([place, of]) => Curves.plot(place, of.unit, of.list, span, t => plots.forEach(plot => plot.cursor(t))));
      box.replaceChildren(...plots.map(plot => plot.element));
      for (const plot of plots) plot.update();
    }
    if (!kinds.size) return null;
    const out = element('section', {id: 'bands'}, element('h2', {}, 'Curves with bands'),
      element('p', {class: 'dim'}, 'Lines: the median of the drawn hands; bands: from the 5th to the 95th percentile at each time, of those whose run goes on. A click or drag in a plot shows the figures at that time; a click on a name hides its curve.'),
      element('div', {class: 'bar'}, kind), box);
    return {out, show};
  }

  const sections = data.tables.map(section), banded = data.bands ? bands(data.bands) : null;
  document.body.append(
    element('header', {}, element('h1', {}, data.title), element('p', {class: 'dim'}, `${data.name}; handsim ${data.handsim}`)),
    element('main', {}, banded ? banded.out : null, sections.map(s => s.out),
      data.study.command ? element('section', {}, element('h2', {}, 'Repeat it'), element('p', {}, element('code', {}, data.study.command))) : null,
      data.about ? element('details', {}, element('summary', {}, 'Figures, machine and versions'), Table.any(data.about)) : null,
      element('p', {class: 'dim'}, 'A click on a head sorts, a click on a row or a point shows the command that repeats it. Numbers have seven digits here, all digits in the tables of the folder. The page needs no network.')));
  for (const s of sections) s.draw();
  if (banded) banded.show();
  /** For tests and scripts in the browser's console. */
  window.handsimReport = {sections, data};
})();
