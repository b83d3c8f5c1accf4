within ;
package {{ package }}
  {{ string("Force over deflection of models of " ~ systems[0].source) }}
  connector RealInput = input Real;
  connector RealOutput = output Real;
{% for system in systems %}
{% set one, belted = system.realised, system.belted %}
{% set count, pairs = one.springs.size, one.pair_springs.size %}

  block {{ system.name }}
    {{ string(system.about ~ ". " ~ system.placed.accuracy.text) }}
{% if belted %}
    RealInput x1(unit="m") "Displacement of the contact towards the wheel";
    RealInput v1(unit="m/s") "Its rate, der(x1)";
    RealInput x2(unit="m") "Displacement of the wheel in the same direction";
    RealInput v2(unit="m/s") "Its rate, der(x2)";
    RealOutput F1(unit="N") "Force into the contact, positive in compression";
    RealOutput F2(unit="N") "Force on the wheel, positive in compression";
    parameter Real mb(unit="kg")={{ system.belt.mass }} "Mass of the belt";
    parameter Real r(unit="1")={{ system.belt.share | abs }} "Spring at the contact over that at the rim";
{% else %}
    RealInput x(unit="m") "Deflection, positive in compression";
    RealInput v(unit="m/s") "Rate of the deflection, der(x)";
    RealOutput F(unit="N") "Force, positive in compression";
{% endif %}
    parameter Real discrepancy(unit="1")={{ system.placed.accuracy.discrepancy }} "Relative error of K*";
    parameter Real K0(unit="N/m")={{ one.rest }} "Stiffness at zero frequency";
    parameter Real C(unit="N.s/m")={{ one.damper }} "Damper";
{% for name, unit, values, what in (
    ("k", "N/m", one.springs, "Stiffness of each branch"),
    ("tau", "s", one.times, "Relaxation time of each branch"),
    ("kr", "N/m", one.pair_springs.real, "Stiffness of each pair, real part"),
    ("ki", "N/m", one.pair_springs.imag, "Stiffness of each pair, imaginary part"),
    ("lr", "1/s", one.pair_rates.real, "Decay of each pair"),
    ("li", "1/s", one.pair_rates.imag, "Angular frequency of each pair"),
) if values.size %}
    parameter Real {{ name }}[{{ values.size }}](each unit="{{ unit }}")={
{% for four in values.tolist() | batch(4) %}
      {{ four | join(", ") }}{{ "," if not loop.last else '} "' ~ what ~ '";' }}
{% endfor %}
{% endfor %}
{# With a belt, the block has the same springs twice: between both ends, and around the belt. #}
{% for end in ("", "b") if belted or not end %}
{% if count %}
    Real z{{ end }}[{{ count }}](each unit="m") "Branches";
{% endif %}
{% if pairs %}
    Real zr{{ end }}[{{ pairs }}](each unit="m") "Pairs, real part";
    Real zi{{ end }}[{{ pairs }}](each unit="m") "Pairs, imaginary part";
{% endif %}
{% endfor %}
{% if belted %}
    Real xb(unit="m") "Displacement of the belt";
    Real vb(unit="m/s") "Its rate";
    Real x(unit="m") "Deflection";
    Real v(unit="m/s") "Its rate";
    Real e(unit="m") "Mean displacement of both ends less that of the belt";
    Real ve(unit="m/s") "Its rate";
    Real S(unit="N") "Force of the springs";
    Real B(unit="N") "Force of the same springs by e";
    Real Q(unit="N") "Force on the belt";
{% endif %}
{% if count or pairs or belted %}
  initial equation
{% for end in ("", "b") if belted or not end %}
{% if count %}
    der(z{{ end }}) = zeros({{ count }});
{% endif %}
{% if pairs %}
    der(zr{{ end }}) = zeros({{ pairs }});
    der(zi{{ end }}) = zeros({{ pairs }});
{% endif %}
{% endfor %}
{% if belted %}
    der(xb) = 0;
    der(vb) = 0;
{% endif %}
{% endif %}
  equation
{% if belted %}
    x = x1 - x2;
    v = v1 - v2;
    e = (r*x1 + x2)/(1 + r) - xb;
    ve = (r*v1 + v2)/(1 + r) - vb;
{% endif %}
{% for end, x, v, force in (("", "x", "v", "S" if belted else "F"), ("b", "e", "ve", "B")) if belted or not end %}
{% if count %}
    der(z{{ end }}) = (fill({{ x }}, {{ count }}) - z{{ end }})./tau;
{% endif %}
{% if pairs %}
    der(zr{{ end }}) = lr.*(fill({{ x }}, {{ pairs }}) - zr{{ end }}) + li.*zi{{ end }};
    der(zi{{ end }}) = li.*(fill({{ x }}, {{ pairs }}) - zr{{ end }}) - lr.*zi{{ end }};
{% endif %}
    {{ force }} = K0*{{ x }} + C*{{ v }}{% if count %} + k*(fill({{ x }}, {{ count }}) - z{{ end }}){% endif %}
{% if pairs %} + kr*(fill({{ x }}, {{ pairs }}) - zr{{ end }}) + ki*zi{{ end }}{% endif %};
{% endfor %}
{% if belted %}
    Q = (1 + r)*(1 + r)/r*B;
    der(xb) = vb;
    der(vb) = Q/mb;
    F1 = S + r/(1 + r)*Q;
    F2 = S - Q/(1 + r);
{% endif %}
  end {{ system.name }};
{% endfor %}
end {{ package }};
